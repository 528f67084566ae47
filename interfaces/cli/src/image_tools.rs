//! `antumbra image`: comparing, converting and drawing images.

use std::path::Path;
use std::process::ExitCode;

use antumbra_image::compare::{self, Comparison, Options, StandardErrors};
use antumbra_image::heatmap::{self, Range};
use antumbra_image::{Allowance, Image, Window};
use serde::Serialize;

use crate::args::{CompareArgs, DisplayArgs, ImageCommand, is_for_displays, usual};
use crate::exit::{Failure, tell};
use crate::output::Files;
use crate::{json, output};

/// Runs the command.
pub fn run(command: &ImageCommand) -> Result<ExitCode, Failure> {
    match command {
        ImageCommand::Compare(args) => {
            return compare_images(args).map_err(|failure| match failure {
                // 1 is kept for images that differ.
                Failure::Work(text) => Failure::Data(text),
                failure => failure,
            });
        }
        ImageCommand::Convert {
            input,
            output,
            layer,
            display,
        } => {
            display.check()?;
            check_files(input, output)?;
            let is_light = layer.is_none() && !is_for_displays(input);
            let image = read_layer(input, layer.as_deref())?;
            display.write(&image, output, usual(is_light))?;
            tell_written(output);
        }
        ImageCommand::Denoise {
            input,
            output,
            library,
            display,
        } => {
            display.check()?;
            check_files(input, output)?;
            denoise(input, output, library.as_deref(), display)?;
        }
        ImageCommand::Heatmap {
            input,
            output,
            range,
            layer,
        } => {
            check_files(input, output)?;
            draw(
                &read_layer(input, layer.as_deref())?,
                output,
                range.as_deref(),
            )?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Refuses an output that would destroy the input, or that cannot be written.
fn check_files(input: &Path, output: &Path) -> Result<(), Failure> {
    let mut files = Files::default();
    files.reads("the image", input)?;
    files.writes("the output", output)?;
    files.check()
}

/// Reads an image within the memory that the program may take.
fn read(path: &Path) -> Result<Image, Failure> {
    let allowance = Allowance::new(antumbra_guard::limit());
    Ok(Image::read_within(path, &allowance)?)
}

/// Ends of the names of channels.
const RGB: [&str; 3] = [".R", ".G", ".B"];
const XYZ: [&str; 3] = [".X", ".Y", ".Z"];

/// Reads three channels of a layer, if they are there.
fn read_channels(path: &Path, layer: &str, ends: [&str; 3]) -> Result<Option<Image>, Failure> {
    let names = ends.map(|end| format!("{layer}{end}"));
    Ok(Image::read_channels(
        path,
        names.each_ref().map(|name| &name[..]),
    )?)
}

/// Reads a layer of an image, or its colours.
fn read_layer(path: &Path, layer: Option<&str>) -> Result<Image, Failure> {
    let Some(layer) = layer else {
        return read(path);
    };
    if !output::is_one_of(path, &["exr"]) {
        let path = path.display();
        return Err(Failure::Usage(format!(
            "--layer: {path} has no layers; an .exr may have"
        )));
    }
    let found = Image::channel_names(path)?;
    for ends in [[""; 3], RGB, XYZ] {
        let names = ends.map(|end| format!("{layer}{end}"));
        if names.iter().all(|name| found.contains(name))
            && let Some(image) = read_channels(path, layer, ends)?
        {
            return Ok(image);
        }
    }
    let mut layers: Vec<&str> = found
        .iter()
        .map(|name| name.rsplit_once('.').map_or(&name[..], |(layer, _)| layer))
        .collect();
    layers.dedup();
    Err(Failure::Usage(format!(
        "--layer: {} has no layer {layer}; it has {}",
        path.display(),
        layers.join(", ")
    )))
}

/// Denoises an image, with its layers if it has them.
fn denoise(
    input: &Path,
    output: &Path,
    library: Option<&Path>,
    display: &DisplayArgs,
) -> Result<(), Failure> {
    let library = antumbra_denoise::Library::open(library)
        .map_err(|error| Failure::Work(error.to_string()))?;
    let color = read(input)?;
    let mut layers = [None, None];
    if output::is_one_of(input, &["exr"]) {
        let albedo = (&["Albedo", "Denoising Albedo"][..], RGB);
        let normal = (&["Ns", "N", "Denoising Normal"][..], XYZ);
        for (layer, (names, ends)) in layers.iter_mut().zip([albedo, normal]) {
            for name in names {
                if layer.is_none() {
                    *layer = read_channels(input, name, ends)?;
                }
            }
        }
    }
    let [albedo, normal] = layers;
    let window = color.window();
    let pixels = library
        .denoise(
            [window.width(), window.height()],
            color.pixels(),
            albedo.as_ref().map(Image::pixels),
            normal.as_ref().map(Image::pixels),
        )
        .map_err(|error| Failure::Work(error.to_string()))?;
    let clean = Image::new(color.width(), color.height(), window, pixels)?;
    display.write(&clean, output, usual(!is_for_displays(input)))?;
    let helped = match (&albedo, &normal) {
        (Some(_), Some(_)) => "with albedo and normals",
        (Some(_), None) => "with albedo",
        _ => "by colours alone; render with --layers for more detail",
    };
    tell(format_args!("wrote {} ({helped})", output.display()));
    Ok(())
}

fn draw(image: &Image, output: &Path, range: Option<&[f32]>) -> Result<(), Failure> {
    let mean =
        |pixel: &[f32; 3]| (pixel.iter().map(|&value| f64::from(value)).sum::<f64>() / 3.0) as f32;
    let field: Vec<f32> = image.pixels().iter().map(mean).collect();
    let range = match range {
        Some(&[min, max]) => Range::Fixed { min, max },
        _ => Range::Max,
    };
    draw_field(&field, image.window(), output, range)?;
    tell_written(output);
    Ok(())
}

/// Draws a value for every pixel in colours.
fn draw_field(field: &[f32], window: Window, output: &Path, range: Range) -> Result<(), Failure> {
    let options = heatmap::Options {
        range,
        ..Default::default()
    };
    let picture = heatmap::render(field, window.width(), window.height(), &options)?;
    Ok(picture.write(output)?)
}

/// Says what was written, unless it is a stream, whose reader knows.
fn tell_written(output: &Path) {
    if !output::is_stream(output) {
        tell(format_args!("wrote {}", output.display()));
    }
}

/// The JSON document.
#[derive(Serialize)]
struct Document {
    schema: &'static str,
    image: String,
    reference: String,
    pass: bool,
    pixels: usize,
    non_finite_image: usize,
    non_finite_reference: usize,
    mse: f64,
    relative_mse: f64,
    psnr: f64,
    max_difference: f64,
    mean_image: [f64; 3],
    mean_reference: [f64; 3],
    mean_difference: [f64; 3],
    /// Standard errors of `mean_difference`; `null` without standard errors of pixels.
    mean_difference_error: Option<[f64; 3]>,
    z_limit: f64,
    z_limit_share: f64,
    rounding: f64,
    pixels_beyond: usize,
    share_beyond: f64,
    worst_z: f64,
    worst_x: i32,
    worst_y: i32,
    worst_channel: usize,
}

fn compare_images(args: &CompareArgs) -> Result<ExitCode, Failure> {
    let mut files = Files::default();
    let images = [&args.image, &args.reference].into_iter();
    for path in images.chain(&args.stderr_a).chain(&args.stderr_b) {
        files.reads("the image", path)?;
    }
    files.writes_some([
        ("--json", args.json.as_ref().map(json::Destination::path)),
        ("--map", args.map.as_deref()),
    ])?;
    files.check()?;
    let mut image = read(&args.image)?;
    let mut reference = read(&args.reference)?;
    let mut error_a = args.stderr_a.as_deref().map(read).transpose()?;
    let mut error_b = args.stderr_b.as_deref().map(read).transpose()?;
    let all = [Some(&mut image), Some(&mut reference)].into_iter();
    let all = all.chain([error_a.as_mut(), error_b.as_mut()]);
    crop_to_common(&mut all.flatten().collect::<Vec<_>>());
    if error_a.is_none() && error_b.is_none() {
        // Both are exact: the test is for equality.
        error_a = Some(zeros(&image)?);
    }
    let errors = StandardErrors {
        image: error_a.as_ref(),
        reference: error_b.as_ref(),
    };
    let options = Options {
        limit: args.limit,
        limit_share: args.share,
        rounding: args.rounding,
    };
    let comparison = compare::compare(&image, &reference, errors, &options)?;
    if let Some(path) = &args.map {
        let field = compare::z_field(&image, &reference, errors, args.rounding)?;
        draw_field(&field, image.window(), path, Range::Max)?;
        tell_written(path);
    }
    let known = [&error_a, &error_b].map(|error| {
        let given = [&args.stderr_a, &args.stderr_b]
            .iter()
            .any(|path| path.is_some());
        error.as_ref().filter(|_| given)
    });
    let of_means = errors_of_means(known, comparison.mean_reference);
    let mut document = document(args, &comparison)?;
    document.mean_difference_error = of_means;
    json::write(&document, args.json.as_ref())?;
    json::print_beside(args.json.as_ref(), &text(&document))?;
    Ok(if document.pass {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

/// Leaves of pictures of one size the pixels that all of them have: a crop is compared with its part of the whole.
fn crop_to_common(images: &mut [&mut Image]) {
    let Some(first) = images.first() else { return };
    let size = |image: &Image| (image.width(), image.height());
    let windows = images.iter().map(|image| image.window());
    let Some(common) = windows.reduce(|a, b| a.intersection(&b)) else {
        return;
    };
    let is_one = images.iter().all(|image| size(image) == size(first));
    let is_whole = images.iter().all(|image| image.window() == common);
    // Pictures of different sizes, or beside each other, are refused with both sizes.
    if is_whole || !is_one || common.is_empty() {
        return;
    }
    tell(format_args!(
        "note: compares the pixels {common}, which all images have"
    ));
    for image in images {
        if let Some(part) = image.cropped(common) {
            **image = part;
        }
    }
}

/// Standard errors of the relative differences of the means, by channel. `None` without standard errors.
///
/// Pixels count as independent, which they are with a box filter of one pixel.
fn errors_of_means(errors: [Option<&Image>; 2], mean_reference: [f64; 3]) -> Option<[f64; 3]> {
    let mut sums = [0.0; 3];
    let mut pixels = None;
    for error in errors.into_iter().flatten() {
        pixels = Some(error.pixels().len() as f64);
        for pixel in error.pixels() {
            for (sum, &value) in sums.iter_mut().zip(pixel) {
                *sum += f64::from(value) * f64::from(value);
            }
        }
    }
    let pixels = pixels?;
    let relative = |channel: usize| sums[channel].sqrt() / pixels / mean_reference[channel].abs();
    Some([0, 1, 2].map(relative))
}

fn zeros(image: &Image) -> Result<Image, Failure> {
    let window: Window = image.window();
    let pixels = vec![[0.0; 3]; window.area()];
    Ok(Image::new(image.width(), image.height(), window, pixels)?)
}

fn document(args: &CompareArgs, comparison: &Comparison) -> Result<Document, Failure> {
    let Some(z) = &comparison.z else {
        return Err(Failure::work("the images were not tested"));
    };
    Ok(Document {
        schema: "antumbra.compare/1",
        image: output::text(&args.image),
        reference: output::text(&args.reference),
        pass: z.pass,
        pixels: comparison.pixels,
        non_finite_image: comparison.non_finite_image,
        non_finite_reference: comparison.non_finite_reference,
        mse: comparison.mse,
        relative_mse: comparison.relative_mse,
        psnr: comparison.psnr,
        max_difference: comparison.max_difference,
        mean_image: comparison.mean_image,
        mean_reference: comparison.mean_reference,
        mean_difference: comparison.mean_difference,
        mean_difference_error: None,
        z_limit: z.options.limit,
        z_limit_share: z.options.limit_share,
        rounding: z.options.rounding,
        pixels_beyond: z.beyond,
        share_beyond: z.share,
        worst_z: z.worst.z,
        worst_x: z.worst.x,
        worst_y: z.worst.y,
        worst_channel: z.worst.channel,
    })
}

fn text(document: &Document) -> String {
    let means = |[r, g, b]: [f64; 3]| format!("{r:.6} {g:.6} {b:.6}");
    let [r, g, b] = document
        .mean_difference
        .map(|difference| 100.0 * difference);
    let errors = document
        .mean_difference_error
        .map_or_else(String::new, |errors| {
            let [r, g, b] = errors.map(|error| 100.0 * error);
            let z = [0, 1, 2].map(|c| document.mean_difference[c] / errors[c]);
            format!(
                "its error    {r:.3} % {g:.3} % {b:.3} %, so z {:+.1} {:+.1} {:+.1}\n",
                z[0], z[1], z[2]
            )
        });
    let channel = ["red", "green", "blue"][document.worst_channel.min(2)];
    format!(
        "MSE          {:.6e}\n\
         relMSE       {:.6e}\n\
         PSNR         {:.2} dB\n\
         largest      {:.6e}\n\
         means        {} against {}\n\
         difference   {r:+.3} % {g:+.3} % {b:+.3} %\n\
         {errors}\
         not finite   {} and {} of {} pixels\n\
         z test       {} pixels ({:.3} %) beyond |z| = {}; worst {:+.2} at ({}, {}) {channel}\n\
         {}",
        document.mse,
        document.relative_mse,
        document.psnr,
        document.max_difference,
        means(document.mean_image),
        means(document.mean_reference),
        document.non_finite_image,
        document.non_finite_reference,
        document.pixels,
        document.pixels_beyond,
        100.0 * document.share_beyond,
        document.z_limit,
        document.worst_z,
        document.worst_x,
        document.worst_y,
        if document.pass { "pass" } else { "FAIL" },
    )
}
