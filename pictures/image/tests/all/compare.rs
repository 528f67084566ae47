//! Error measures compared with closed forms, and the z test compared with the normal distribution.

use crate::support::{Random, image};
use antumbra_image::compare::{
    Comparison, Options, RELATIVE_MSE_EPSILON, StandardErrors, ZTest, compare, difference_field,
    z_field,
};
use antumbra_image::{Error, Image, Window};

fn plain(a: &Image, b: &Image) -> Comparison {
    compare(a, b, StandardErrors::default(), &Options::default()).unwrap()
}

fn z_test(a: &Image, b: &Image, error_a: &Image, error_b: &Image, options: &Options) -> ZTest {
    let errors = StandardErrors {
        image: Some(error_a),
        reference: Some(error_b),
    };
    compare(a, b, errors, options).unwrap().z.unwrap()
}

fn close(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-12 * a.abs().max(b.abs())
}

#[test]
fn equal_images() {
    let picture = image(5, 4, |x, y| [x as f32, -1.0, y as f32]);
    let result = plain(&picture, &picture);
    assert_eq!(result.pixels, 20);
    assert_eq!((result.mse, result.relative_mse), (0.0, 0.0));
    assert_eq!(result.psnr, f64::INFINITY);
    assert_eq!(result.max_difference, 0.0);
    assert_eq!(result.mean_image, [2.0, -1.0, 1.5]);
    assert_eq!(result.mean_difference, [0.0; 3]);
    assert_eq!(result.z, None);
}

#[test]
fn constant_offset() {
    // All values are exact in binary, so the closed forms are met to the last bits.
    let reference = image(7, 3, |_, _| [1.0, -2.0, 0.0]);
    let picture = image(7, 3, |_, _| [1.25, -1.75, 0.25]);
    let result = plain(&picture, &reference);
    assert_eq!(result.mse, 0.0625);
    let e = RELATIVE_MSE_EPSILON;
    let expected = 0.0625 / 3.0 * (1.0 / (1.0 + e) + 1.0 / (4.0 + e) + 1.0 / e);
    assert!(close(result.relative_mse, expected));
    assert!(close(result.psnr, 10.0 * 16f64.log10()));
    assert_eq!(result.max_difference, 0.25);
    assert_eq!(result.mean_image, [1.25, -1.75, 0.25]);
    assert_eq!(result.mean_reference, [1.0, -2.0, 0.0]);
    assert_eq!(result.mean_difference, [0.25, 0.125, f64::INFINITY]);
}

#[test]
fn single_outlier() {
    let reference = image(10, 10, |_, _| [0.5; 3]);
    let mut picture = reference.clone();
    picture.pixels_mut()[37][2] = 100.5;
    let result = plain(&picture, &reference);
    assert!(close(result.mse, 10_000.0 / 300.0));
    assert_eq!(result.max_difference, 100.0);
    let field = difference_field(&picture, &reference).unwrap();
    assert_eq!(field.iter().position(|&value| value == 100.0), Some(37));
    assert_eq!(field.iter().sum::<f32>(), 100.0);
}

#[test]
fn huge_values_do_not_overflow() {
    let a = image(1, 1, |_, _| [f32::MAX; 3]);
    let b = image(1, 1, |_, _| [f32::MIN; 3]);
    let result = plain(&a, &b);
    assert_eq!(result.max_difference, 2.0 * f64::from(f32::MAX));
    assert!(result.mse.is_finite());
    assert!(close(result.mse, (2.0 * f64::from(f32::MAX)).powi(2)));
}

#[test]
fn non_finite_pixels_are_counted_and_left_out() {
    let reference = image(4, 1, |_, _| [1.0; 3]);
    let mut picture = image(4, 1, |_, _| [2.0; 3]);
    picture.pixels_mut()[0][1] = f32::NAN;
    picture.pixels_mut()[2][0] = f32::INFINITY;
    let result = plain(&picture, &reference);
    assert_eq!(
        (result.non_finite_image, result.non_finite_reference),
        (2, 0)
    );
    assert_eq!(result.mse, 1.0);
    assert_eq!(result.mean_image, [2.0; 3]);
    assert_eq!(result.mean_difference, [1.0; 3]);
    let field = difference_field(&picture, &reference).unwrap();
    assert!(field[0].is_nan() && field[2].is_nan());
    assert_eq!((field[1], field[3]), (1.0, 1.0));

    let error = image(4, 1, |_, _| [1.0; 3]);
    let test = z_test(&picture, &reference, &error, &error, &Options::default());
    assert_eq!(test.beyond, 2);
    assert_eq!(test.worst.z, f64::INFINITY);
    assert_eq!((test.worst.x, test.worst.channel), (0, 1));

    let nothing = image(4, 1, |_, _| [f32::NAN; 3]);
    let result = plain(&nothing, &nothing);
    assert_eq!(
        (result.non_finite_image, result.non_finite_reference),
        (4, 4)
    );
    let measures = [result.mse, result.relative_mse, result.psnr];
    assert!(measures.iter().all(|measure| measure.is_nan()));
    assert!(result.max_difference.is_nan() && result.mean_image[0].is_nan());
}

#[test]
fn z_of_known_errors() {
    let window = Window {
        x0: 10,
        y0: 20,
        x1: 12,
        y1: 22,
    };
    let make = |pixels: [[f32; 3]; 4]| Image::new(50, 50, window, pixels.to_vec()).unwrap();
    // Differences 5, -10 and 1 over an error of hypot(3, 4) = 5.
    let reference = make([[1.0; 3]; 4]);
    let picture = make([[6.0, 1.0, 1.0], [1.0; 3], [1.0, -9.0, 1.0], [1.0, 1.0, 2.0]]);
    let (three, four) = (make([[3.0; 3]; 4]), make([[4.0; 3]; 4]));
    let options = Options {
        limit: 1.5,
        limit_share: 0.25,
        rounding: 0.0,
    };
    let test = z_test(&picture, &reference, &three, &four, &options);
    assert_eq!((test.beyond, test.share, test.pass), (1, 0.25, true));
    let worst = test.worst;
    assert_eq!(
        (worst.x, worst.y, worst.channel, worst.z),
        (10, 21, 1, -2.0)
    );

    let strict = Options {
        limit_share: 0.24,
        ..options
    };
    assert!(!z_test(&picture, &reference, &three, &four, &strict).pass);
    // A z equal to the limit is not beyond it.
    let at_limit = Options {
        limit: 2.0,
        limit_share: 0.0,
        rounding: 0.0,
    };
    assert!(z_test(&picture, &reference, &three, &four, &at_limit).pass);

    // A standard error of one image only.
    for errors in [
        StandardErrors {
            image: Some(&four),
            reference: None,
        },
        StandardErrors {
            image: None,
            reference: Some(&four),
        },
    ] {
        let field = z_field(&picture, &reference, errors, 0.0).unwrap();
        assert_eq!(field, [1.25, 0.0, 2.5, 0.25]);
    }
}

#[test]
fn zero_and_useless_errors() {
    let reference = image(6, 1, |_, _| [1.0; 3]);
    let mut picture = reference.clone();
    picture.pixels_mut()[1] = [1.0, 0.5, 1.0];
    let mut error = image(6, 1, |_, _| [0.0; 3]);
    error.pixels_mut()[2][0] = f32::NAN;
    error.pixels_mut()[3][0] = -1.0;
    error.pixels_mut()[4][0] = f32::INFINITY;
    let errors = StandardErrors {
        image: None,
        reference: Some(&error),
    };
    let inf = f32::INFINITY;
    let field = z_field(&picture, &reference, errors, 0.0).unwrap();
    assert_eq!(field, [0.0, inf, inf, inf, inf, 0.0]);
    let result = compare(&picture, &reference, errors, &Options::default());
    let test = result.unwrap().z.unwrap();
    assert_eq!(test.beyond, 4);
    assert!(!test.pass);
    let worst = test.worst;
    assert_eq!((worst.x, worst.channel, worst.z), (1, 1, f64::NEG_INFINITY));
    // An infinite z is beyond every limit but infinity itself.
    let huge = Options {
        limit: f64::MAX,
        ..Options::default()
    };
    let test = compare(&picture, &reference, errors, &huge)
        .unwrap()
        .z
        .unwrap();
    assert_eq!(test.beyond, 4);
}

#[test]
fn rounding_is_forgiven_only_when_asked() {
    let reference = image(3, 1, |_, _| [0.325, -0.325, 0.0]);
    let mut picture = reference.clone();
    let next = f32::from_bits(0.325f32.to_bits() + 1);
    picture.pixels_mut()[0] = [next, -next, 0.0];
    picture.pixels_mut()[1][0] = 0.3251;
    picture.pixels_mut()[2][2] = 1e-30;
    let error = image(3, 1, |_, _| [0.0; 3]);
    let errors = StandardErrors {
        image: None,
        reference: Some(&error),
    };
    let inf = f32::INFINITY;
    let strict = z_field(&picture, &reference, errors, 0.0).unwrap();
    assert_eq!(strict, [inf, inf, inf]);
    let lenient = z_field(&picture, &reference, errors, 1e-5).unwrap();
    assert_eq!(lenient, [0.0, inf, inf]);
    let options = Options {
        rounding: 1e-5,
        ..Options::default()
    };
    let test = compare(&picture, &reference, errors, &options)
        .unwrap()
        .z
        .unwrap();
    assert_eq!(test.beyond, 2);
}

/// Two estimates of one picture, and their true standard errors.
fn estimates(size: usize, seed: u64, bias: f64) -> [Image; 4] {
    println!("seed {seed:#x}");
    let mut random = Random(seed);
    let truth = image(size, size, |_, _| {
        std::array::from_fn(|_| random.uniform() as f32)
    });
    let mut error = |scale: f64| {
        image(size, size, |_, _| {
            std::array::from_fn(|_| (scale * (0.5 + random.uniform())) as f32)
        })
    };
    let errors = [error(0.1), error(0.03)];
    let mut noisy = |error: &Image, bias: f64| {
        image(size, size, |x, y| {
            let (value, error) = (truth.get(x, y).unwrap(), error.get(x, y).unwrap());
            std::array::from_fn(|c| {
                (f64::from(value[c]) + f64::from(error[c]) * (random.normal() + bias)) as f32
            })
        })
    };
    let [a, b] = [noisy(&errors[0], bias), noisy(&errors[1], 0.0)];
    let [error_a, error_b] = errors;
    [a, b, error_a, error_b]
}

#[test]
fn gaussian_noise_is_beyond_as_often_as_theory_says() {
    let [a, b, error_a, error_b] = estimates(512, 0x5eed_0003, 0.0);
    let pixels = 512.0 * 512.0;
    // Probability of |z| > limit for one channel, from tables of the normal distribution.
    for (limit, tail) in [
        (1.0, 0.317_310_507_863),
        (2.0, 0.045_500_263_896),
        (3.0, 0.002_699_796_063),
        (4.0, 6.334_248_367e-5),
    ] {
        let options = Options {
            limit,
            ..Options::default()
        };
        let test = z_test(&a, &b, &error_a, &error_b, &options);
        let expected = 1.0 - (1.0_f64 - tail).powi(3);
        let sigma = (expected * (1.0 - expected) / pixels).sqrt();
        println!(
            "limit {limit}: share {}, expected {expected} +- {sigma}",
            test.share
        );
        assert!((test.share - expected).abs() < 5.0 * sigma);
        assert_eq!(test.share, test.beyond as f64 / pixels);
    }
    assert!(z_test(&a, &b, &error_a, &error_b, &Options::default()).pass);
}

#[test]
fn a_wrong_image_fails() {
    let [a, b, error_a, error_b] = estimates(64, 0x5eed_0004, 3.0);
    let test = z_test(&a, &b, &error_a, &error_b, &Options::default());
    assert!(test.share > 0.1 && !test.pass, "{}", test.share);
}

#[test]
fn the_field_and_the_test_agree() {
    let [a, b, error_a, error_b] = estimates(64, 0x5eed_0005, 1.0);
    let errors = StandardErrors {
        image: Some(&error_a),
        reference: Some(&error_b),
    };
    let options = Options {
        limit: 2.0,
        ..Options::default()
    };
    let test = z_test(&a, &b, &error_a, &error_b, &options);
    let field = z_field(&a, &b, errors, 0.0).unwrap();
    assert_eq!(field.iter().filter(|&&z| z > 2.0).count(), test.beyond);
    let worst = field.iter().copied().fold(0.0, f32::max);
    assert_eq!(worst, test.worst.z.abs() as f32);
    let index = test.worst.y as usize * 64 + test.worst.x as usize;
    assert_eq!(field[index], worst);
}

#[test]
fn sizes_and_options_are_checked() {
    let a = image(4, 3, |_, _| [0.0; 3]);
    let b = image(3, 4, |_, _| [0.0; 3]);
    let crop = Window {
        x0: 1,
        y0: 0,
        x1: 4,
        y1: 3,
    };
    let c = Image::from_fn(4, 3, crop, |_, _| [0.0; 3]).unwrap();
    let none = StandardErrors::default();
    let options = Options::default();

    let message = compare(&a, &b, none, &options).unwrap_err().to_string();
    assert!(
        message.contains("4 x 3") && message.contains("3 x 4"),
        "{message}"
    );
    let error = compare(&a, &c, none, &options).unwrap_err();
    assert!(matches!(error, Error::SizeMismatch { .. }));
    assert!(error.to_string().contains("[1, 4) x [0, 3)"), "{error}");
    let errors = StandardErrors {
        image: Some(&a),
        reference: Some(&b),
    };
    let message = compare(&a, &a, errors, &options).unwrap_err().to_string();
    assert!(
        message.contains("the standard error of the reference"),
        "{message}"
    );
    assert!(difference_field(&a, &b).is_err());
    assert!(z_field(&a, &a, errors, 0.0).is_err());

    let nan = f64::NAN;
    for (limit, limit_share, rounding) in [
        (-1.0, 0.5, 0.0),
        (nan, 0.5, 0.0),
        (4.0, -0.1, 0.0),
        (4.0, 1.1, 0.0),
        (4.0, nan, 0.0),
        (4.0, 0.5, -1e-9),
        (4.0, 0.5, nan),
    ] {
        let options = Options {
            limit,
            limit_share,
            rounding,
        };
        let error = compare(&a, &a, none, &options).unwrap_err();
        assert!(matches!(error, Error::BadOption { .. }));
    }
    assert!(z_field(&a, &a, none, nan).is_err());
}
