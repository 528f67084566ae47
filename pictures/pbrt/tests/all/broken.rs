//! Broken files, and the place and words of each message.

use antumbra_pbrt::{Diagnostic, Error, Options, Severity, load};

use super::{OPTIONS, complaints, load_files, load_text};

/// Checks that there is a mistake at a place, with the given words in its message or help.
fn assert_complains(diagnostics: &[Diagnostic], line: u32, column: u32, words: &str) {
    let fits = |d: &Diagnostic| {
        let said = format!("{} {}", d.message, d.help.as_deref().unwrap_or_default());
        d.line == line && d.column == column && said.contains(words)
    };
    assert!(
        diagnostics.iter().any(fits),
        "there should be a complaint at {line}:{column} about {words:?}, but:\n{diagnostics:#?}"
    );
}

#[test]
fn single_mistakes() {
    // The mark is before the place of the mistake.
    #[rustfmt::skip]
    const CASES: &[(&str, &str)] = &[
        // Syntax.
        (r#"WorldBegin
  ›Shpae "sphere"
WorldEnd"#, r#"unknown directive Shpae"#),
        (r#"WorldBegin
  ›Shpae "sphere"
WorldEnd"#, r#"did you mean Shape?"#),
        (r#"WorldBegin ›5 WorldEnd"#, r#"expected a directive, found 5"#),
        (r#"WorldBegin ›] WorldEnd"#, r#"expected a directive, found ]"#),
        (r#"›NUL WorldBegin WorldEnd"#, r#"unknown directive"#),
        (r#"Camera ›perspective WorldBegin WorldEnd"#, r#"a name in quotes"#),
        (r#"Camera ›"perspective
WorldBegin WorldEnd"#, r#"does not end on its line"#),
        (r#"Film "image" "float scale" ›[1 2
WorldBegin WorldEnd"#, r#"not closed"#),
        (r#"Film "image" "float scale" [›[1]]
WorldBegin WorldEnd"#, r#"do not nest"#),
        (r#"Film "image" ›"float scale"
WorldBegin WorldEnd"#, r#"no value"#),
        (r#"Film "image" ›"scale" 1
WorldBegin WorldEnd"#, r#"does not declare"#),
        (r#"Film "image" ›"flaot scale" 1
WorldBegin WorldEnd"#, r#"did you mean "float""#),
        (r#"Translate 1 2
›WorldBegin WorldEnd"#, r#"Translate takes 3 numbers"#),
        (r#"Translate 1 2 ›1e999
WorldBegin WorldEnd"#, r#"Translate takes 3 numbers"#),
        (r#"Transform ›1
WorldBegin WorldEnd"#, r#"16 numbers in [ ]"#),
        (r#"ActiveTransform ›Sometimes WorldBegin WorldEnd"#, r#"All, StartTime or EndTime"#),
        (r#"WorldBegin WorldEnd ›Translate"#, r#"the file ends here"#),
        (r#"Film ›"im\age" WorldBegin WorldEnd"#, r#"unknown escape \a"#),
        // Types and values of parameters.
        (r#"WorldBegin Material "matte" ›"float Kd" .5 WorldEnd"#, r#"is of type rgb or"#),
        (r#"Camera "perspective" ›"string fov" "x" WorldBegin WorldEnd"#, r#"type float, found type string"#),
        (r#"Camera "perspective" "float fov" ›"x" WorldBegin WorldEnd"#, r#"takes numbers, found the string "x""#),
        (r#"Camera "perspective" ›"float fvo" 1 WorldBegin WorldEnd"#, r#"did you mean "fov""#),
        (r#"Camera "perspective" "float fov" ›[1 2] WorldBegin WorldEnd"#, r#"takes one value, found 2"#),
        (r#"Camera "perspective" "float fov" [›200] WorldBegin WorldEnd"#, r#"200 degrees"#),
        (r#"Camera "perspective" "float fov" ›nan WorldBegin WorldEnd"#, r#"finite"#),
        (r#"Film "image" "integer xresolution" ›1.5 WorldBegin WorldEnd"#, r#"1.5 is not an integer"#),
        (r#"Film "image" "integer xresolution" ›3000000000 WorldBegin WorldEnd"#, r#"beyond the range"#),
        (r#"Film "image" "integer xresolution" ›1e999 WorldBegin WorldEnd"#, r#"beyond the range"#),
        (r#"Film "image" "integer xresolution" ›0 WorldBegin WorldEnd"#, r#"at least 1"#),
        (r#"Film "image" "float scale" ›1e99 WorldBegin WorldEnd"#, r#"beyond the range"#),
        (r#"Film "image" "float cropwindow" ›[.5 .5 0 1] WorldBegin WorldEnd"#, r#"no pixel"#),
        (r#"Film "image" "bool x" ›maybe WorldBegin WorldEnd"#, r#""true" or "false""#),
        (r#"WorldBegin Material "matte" "rgb Kd" ›[1 2] WorldEnd"#, r#"groups of 3, found 2"#),
        (r#"WorldBegin Material "matte" "rgb Kd" ›[-1 2 3] WorldEnd"#, r#"must not be negative"#),
        (r#"WorldBegin LightSource "infinite" "blackbody L" [›0 1] WorldEnd"#, r#"temperature 0"#),
        (r#"Film "image" WorldBegin ›Attribute "shape" "float radius" 2 WorldEnd"#, r#"directive of pbrt-v4"#),
        (r#"WorldBegin LightSource "infinite" "spectrum L" ›"no.spd" WorldEnd"#, r#"cannot read spectrum"#),
        (r#"WorldBegin LightSource "infinite" "integer samples" ›0 WorldEnd"#, r#"at least 1"#),
        (r#"PixelFilter "box" "float xwidth" ›64.5 WorldBegin WorldEnd"#, r#"at most 64, found 64.5"#),
        (r#"PixelFilter "box" "float ywidth" ›0 WorldBegin WorldEnd"#, r#"positive"#),
        (r#"Scale 1e-15 1e-15 1e-15 ›Camera "perspective" WorldBegin WorldEnd"#, r#"determinant is inf"#),
        (r#"Scale 1e20 1e20 1e20 ›Camera "perspective" WorldBegin WorldEnd"#, r#"determinant is 0"#),
        (r#"Scale 1 0 1 ›Camera "perspective" WorldBegin WorldEnd"#, r#"cannot be inverted"#),
        // Names.
        (r#"Sampler ›"magic" WorldBegin WorldEnd"#, r#"known: 02sequence, halton"#),
        (r#"Integrator ›"paht" WorldBegin WorldEnd"#, r#"did you mean "path""#),
        (r#"›Camera "realistic" WorldBegin WorldEnd"#, r#"needs a parameter "lensfile""#),
        (r#"Film "rgb" Camera ›"realistic" WorldBegin"#, r#"not supported yet"#),
        (r#"Accelerator "qbvh" "string order" ›"random" WorldBegin WorldEnd"#, r#"known: simple, sort+"#),
        (r#"Accelerator "bvh" ›"string order" "simple" WorldBegin WorldEnd"#, r#"no parameter "order""#),
        (r#"WorldBegin ›Material "mix" "string namedmaterial1" "a" WorldEnd"#, r#"needs a parameter "namedmaterial2""#),
        (r#"WorldBegin Material "mix" "string namedmaterial1" ›"a" "string namedmaterial2" "a" WorldEnd"#, r#"no material is named "a""#),
        (r#"WorldBegin MakeNamedMaterial "a" "string type" "none" MakeNamedMaterial "b" "string type" "matte" Material "mix" "string namedmaterial1" ›"a" "string namedmaterial2" "b" WorldEnd"#, r#"is no surface"#),
        (r#"WorldBegin Material "metal" "spectrum eta" ›"spds/Cu.eta.spd" WorldEnd"#, r#"write it as "rgb eta""#),
        (r#"WorldBegin Material "substrate" "float uroughness" ›-1 WorldEnd"#, r#"must not be negative, found -1"#),
        (r#"WorldBegin Material "uber" "float index" ›0 WorldEnd"#, r#"must be positive"#),
        (r#"WorldBegin Material ›"mate" WorldEnd"#, r#"did you mean "matte""#),
        (r#"WorldBegin NamedMaterial ›"x" WorldEnd"#, r#"no material is named "x""#),
        (r#"WorldBegin MakeNamedMaterial ›"x" WorldEnd"#, r#"has no type"#),
        (r#"WorldBegin Material "matte" "texture Kd" ›"t" WorldEnd"#, r#"no color texture is named "t""#),
        (r#"WorldBegin Texture "t" "color" "ptex" Material "matte" "texture Kd" ›"t" WorldEnd"#, r#""ptex" are not supported yet"#),
        (r#"WorldBegin Texture "t" "float" "marble" Material "plastic" "texture roughness" ›"t" WorldEnd"#, r#""marble of numbers" are not supported"#),
        (r#"WorldBegin ›Shape "loopsubdiv" "point P" [0 0 0 1 0 0 0 1 0 0 0 1] "integer indices" [0 1 2 0 1 3] WorldEnd"#, r#"is no surface"#),
        (r#"WorldBegin ›Shape "loopsubdiv" "integer indices" [0 1 2] WorldEnd"#, r#"needs a parameter "P""#),
        (r#"WorldBegin Shape "loopsubdiv" "point P" [0 0 0 1 0 0 0 1 0] "integer indices" [0 1 ›3] WorldEnd"#, r#"vertex index 3 is out of range"#),
        (r#"WorldBegin ›Shape "loopsubdiv" "point P" [0 0 0 1 0 0 0 1 0] "integer indices" [0 1 2] "integer levels" 24 WorldEnd"#, r#"more triangles than memory allows"#),
        (r#"WorldBegin Shape "loopsubdiv" "point P" [0 0 0 1 0 0 0 1 0] "integer indices" [0 1 2] "integer levels" ›25 WorldEnd"#, r#"at most 24"#),
        (r#"WorldBegin Texture "t" "float" ›"wood" WorldEnd"#, r#"unknown texture class"#),
        (r#"WorldBegin Texture "t" ›"number" "constant" WorldEnd"#, r#"known: float, color, spectrum"#),
        (r#"WorldBegin Texture "t" "float" "constant" ›"rgb value" [1 1 1] WorldEnd"#, r#"is of type float, found type rgb"#),
        (r#"WorldBegin Texture "t" "float" "scale" "texture tex1" ›"s" WorldEnd"#, r#"no float texture is named "s""#),
        (r#"WorldBegin ›Texture "t" "float" "imagemap" WorldEnd"#, r#"needs a parameter "filename""#),
        (r#"WorldBegin Texture "t" "float" "imagemap" "string filename" ›"no.png" WorldEnd"#, r#"cannot read image "no.png""#),
        (r#"WorldBegin Texture "t" "float" "imagemap" "string filename" ›"a.gif" WorldEnd"#, r#"known: exr, png, hdr, jpeg, jpg, pfm, pic, tga"#),
        (r#"WorldBegin Texture "t" "float" "checkerboard" "string mapping" ›"plane" WorldEnd"#, r#"did you mean "planar""#),
        (r#"WorldBegin Texture "t" "float" "checkerboard" "string aamode" ›"box" WorldEnd"#, r#""aamode" cannot be "box""#),
        (r#"WorldBegin ›Texture "t" "float" "checkerboard" "integer dimension" 4 WorldEnd"#, r#"2 or 3 dimensions, found 4"#),
        (r#"WorldBegin Scale 1 0 1 ›Texture "t" "float" "bilerp" "string mapping" "spherical" WorldEnd"#, r#"cannot be inverted"#),
        (r#"WorldBegin Texture "t" "float" "bilerp" ›"point v1" [0 0 0] "string mapping" "planar" WorldEnd"#, r#"is of type vector, found type point"#),
        (r#"WorldBegin LightSource "projection" "string mapname" ›"no.exr" WorldEnd"#, r#"cannot read image "no.exr""#),
        (r#"WorldBegin LightSource "goniometric" "string mapname" ›"no.tga" WorldEnd"#, r#"cannot read image "no.tga""#),
        (r#"WorldBegin LightSource "infinite" "string mapname" ›"sky.txt" WorldEnd"#, r#"the image format is not supported"#),
        (r#"WorldBegin LightSource "projection" "float fov" ›180 WorldEnd"#, r#""fov" must be positive and at most 179.9"#),
        (r#"WorldBegin Transform [1 0 0 1 0 1 0 0 0 0 1 0 0 0 0 1] ›LightSource "goniometric" WorldEnd"#, r#"perspective transformation"#),
        (r#"WorldBegin LightSource ›"sun" WorldEnd"#, r#"unknown light"#),
        (r#"WorldBegin AreaLightSource ›"dif" WorldEnd"#, r#"known: area, diffuse"#),
        (r#"WorldBegin CoordSysTransform ›"x" WorldEnd"#, r#"known: world"#),
        // Media.
        (r#"WorldBegin ›MakeNamedMedium "m" WorldEnd"#, r#"needs a parameter "type""#),
        (r#"WorldBegin MakeNamedMedium "m" "string type" ›"fog" WorldEnd"#, r#"known: heterogeneous, homogeneous"#),
        (r#"WorldBegin ›MakeNamedMedium "m" "string type" "homogeneous" "float g" 1 WorldEnd"#, r#"between -1 and 1"#),
        (r#"WorldBegin ›MakeNamedMedium "m" "string type" "heterogeneous" WorldEnd"#, r#"needs a parameter "density""#),
        (r#"WorldBegin MakeNamedMedium "m" "string type" "heterogeneous" "integer nx" 2 "float density" ›[1] WorldEnd"#, r#"1 values of "density" for 2 x 1 x 1 cells"#),
        (r#"WorldBegin MakeNamedMedium "m" "string type" "heterogeneous" "integer nx" 2 "float density" [1 ›-1] WorldEnd"#, r#"finite and not negative"#),
        (r#"WorldBegin ›MakeNamedMedium "m" "string type" "heterogeneous" "float density" 1 "point p1" [1 0 1] WorldEnd"#, r#"box of the medium is empty"#),
        // Shapes.
        (r#"WorldBegin ›Shape "hyperboloid" "point p1" [-1 0 -1] "point p2" [1 0 1] WorldEnd"#, r#"crosses the axis between its ends is not supported yet"#),
        (r#"WorldBegin Shape "plymesh" "string filename" [›"no.ply"] WorldEnd"#, r#"cannot read mesh "no.ply""#),
        (r#"WorldBegin ›Shape "plymesh" WorldEnd"#, r#"needs a parameter "filename""#),
        (r#"WorldBegin Shape "sphere" "float radius" ›0 WorldEnd"#, r#""radius" must be positive"#),
        (r#"WorldBegin ›Shape "sphere" "float zmin" 1 WorldEnd"#, r#"shape "sphere" has no surface"#),
        (r#"WorldBegin ›Shape "cylinder" "float phimax" 0 WorldEnd"#, r#"shape "cylinder" has no surface"#),
        (r#"WorldBegin ›Shape "cylinder" "float zmin" 1 WorldEnd"#, r#"shape "cylinder" has no surface"#),
        (r#"WorldBegin ›Shape "disk" "float innerradius" 1 WorldEnd"#, r#"shape "disk" has no surface"#),
        (r#"WorldBegin Scale 1e30 1e30 1e30 ›Shape "sphere" "float radius" 1e20 WorldEnd"#, r#"beyond the range"#),
        (r#"WorldBegin ›Shape "curve" WorldEnd"#, r#"needs a parameter "P""#),
        (r#"WorldBegin ›Shape "curve" "point P" [0 0 0 1 0 0 2 0 0] WorldEnd"#, r#"3 points "P" make no curve; a curve needs 4 and any number of times 3 more"#),
        (r#"WorldBegin ›Shape "curve" "string basis" "bspline" "integer degree" 2 "point P" [0 0 0 1 0 0] WorldEnd"#, r#"a curve needs at least 3"#),
        (r#"WorldBegin Material "hair" "float eta" ›-1 WorldEnd"#, r#"must be positive, found -1"#),
        (r#"WorldBegin Shape "nurbs" "integer nu" 2 "integer nv" 2 "integer uorder" 2 "integer vorder" 2
"float uknots" [0 0 1 1] "float vknots" [0 0 1 1] "point P" [0 0 0  1 0 0  0 ›nan 0  1 1 0] WorldEnd"#, r#""P" must be finite, found NaN"#),
        (r#"WorldBegin Shape "nurbs" "integer nu" 2 "integer nv" 2 "integer uorder" 2 "integer vorder" 2
"float uknots" [0 0 1 1] "float vknots" [0 0 1 1] "float Pw" [0 0 0 1  1 0 0 ›-1  0 1 0 1  1 1 0 1] WorldEnd"#, r#"must not be negative, found -1"#),
        (r#"WorldBegin ›Shape "curve" "string type" "ribbon" "point P" [0 0 0 1 0 0 2 0 0 3 0 0] "normal N" [0 0 1 0 0 0] WorldEnd"#, r#"has no direction"#),
        (r#"WorldBegin Shape "curve" "string basis" ›"nurbs" "point P" [0 0 0 1 0 0 2 0 0 3 0 0] WorldEnd"#, r#""basis" cannot be "nurbs""#),
        (r#"WorldBegin ›Shape "curve" "integer degree" 4 "point P" [0 0 0 1 0 0 2 0 0 3 0 0] WorldEnd"#, r#"degree 2 or 3, found 4"#),
        (r#"WorldBegin ›Shape "curve" "float width" 0 "point P" [0 0 0 1 0 0 2 0 0 3 0 0] WorldEnd"#, r#"has no width"#),
        (r#"WorldBegin ›Shape "curve" "string type" "ribbon" "point P" [0 0 0 1 0 0 2 0 0 3 0 0] WorldEnd"#, r#"needs 2 normals "N", found 0"#),
        (r#"WorldBegin AreaLightSource "diffuse" ›Shape "curve" "point P" [0 0 0 1 0 0 2 0 0 3 0 0] WorldEnd"#, r#"area light on a curve"#),
        (r#"WorldBegin Scale 1 0 1 ›Shape "sphere" WorldEnd"#, r#"cannot be inverted"#),
        (r#"WorldBegin ObjectBegin "a" ActiveTransform EndTime Translate 1 0 0 ›Shape "sphere" ObjectEnd WorldEnd"#, r#"moving shapes within objects"#),
        (r#"WorldBegin Shape "trianglemesh" "point P" [0 0 0] "integer indices" [0
 0 ›1] WorldEnd"#, r#"vertex index 1 is out of range: "P" has 1 points"#),
        (r#"WorldBegin Shape "trianglemesh" "point P" [0 0 0] "integer indices" [0 ›-1 0] WorldEnd"#, r#"vertex index -1"#),
        (r#"WorldBegin Shape "trianglemesh" "point P" [0 0 0] "integer indices" ›[0 0] WorldEnd"#, r#"2 indices"#),
        (r#"WorldBegin Shape "trianglemesh" "point P" [0 0 0] "integer indices" [0 0 0] "normal N" ›[1 0 0 1 0 0] WorldEnd"#, r#""N" has 2 values"#),
        (r#"WorldBegin ›Shape "trianglemesh" "point P" [0 0 0] WorldEnd"#, r#"needs a parameter "indices""#),
        (r#"WorldBegin Shape "trianglemesh" "point P" [0 0 0] "integer indices" [0 0 0] "texture alpha" ›"a" WorldEnd"#, r#"no float texture is named "a""#),
        (r#"WorldBegin Shape "sphere" ›"float alpha" 0 WorldEnd"#, r#"has no parameter "alpha""#),
        // Order and blocks.
        (r#"›Shape "sphere" WorldBegin WorldEnd"#, r#"Shape belongs between WorldBegin and WorldEnd"#),
        (r#"WorldBegin ›Film "image" WorldEnd"#, r#"Film belongs before WorldBegin"#),
        (r#"WorldBegin ›WorldBegin WorldEnd"#, r#"WorldBegin within"#),
        (r#"WorldBegin WorldEnd ›WorldBegin WorldEnd"#, r#"after WorldEnd"#),
        (r#"WorldBegin
›"#, r#"without WorldEnd"#),
        (r#"›"#, r#"no WorldBegin"#),
        (r#"WorldBegin ›AttributeEnd WorldEnd"#, r#"AttributeEnd without AttributeBegin"#),
        (r#"WorldBegin
›AttributeBegin WorldEnd"#, r#"no AttributeEnd"#),
        (r#"WorldBegin ›TransformEnd WorldEnd"#, r#"TransformEnd without"#),
        (r#"WorldBegin ›ObjectEnd WorldEnd"#, r#"ObjectEnd without"#),
        (r#"WorldBegin AttributeBegin
TransformBegin ›AttributeEnd WorldEnd"#, r#"TransformBegin in line 2"#),
        (r#"WorldBegin ObjectInstance ›"tree" WorldEnd"#, r#"no object is named "tree""#),
        (r#"WorldBegin ObjectBegin "a"
›ObjectBegin "b" ObjectEnd ObjectEnd WorldEnd"#, r#"ObjectBegin within that of line 1"#),
        (r#"WorldBegin ObjectBegin "a" ›ObjectInstance "a" ObjectEnd WorldEnd"#, r#"ObjectInstance within the ObjectBegin of line 1"#),
        (r#"WorldBegin
›ObjectBegin "a" WorldEnd"#, r#"no ObjectEnd"#),
        (r#"WorldBegin ObjectBegin "a" ObjectEnd Scale 0 1 1 ›ObjectInstance "a" WorldEnd"#, r#"cannot be inverted"#),
        (r#"WorldBegin ObjectBegin "a" ObjectEnd Scale 1e30 1e30 1e30 Scale 1e30 1 1 ›ObjectInstance "a" WorldEnd"#, r#"cannot be inverted"#),
        (r#"WorldBegin ObjectBegin "a" ObjectEnd Transform [1 0 0 1 0 1 0 0 0 0 1 0 0 0 0 1] ›ObjectInstance "a" WorldEnd"#, r#"perspective transformation"#),
        (r#"WorldBegin ObjectBegin "a" Shape "sphere" ObjectEnd Scale 1 2 1 ›ObjectInstance "a" WorldEnd"#, r#"ellipsoid"#),
        (r#"WorldBegin ObjectBegin "a" ObjectEnd ActiveTransform EndTime Scale 1 1 -1 ›ObjectInstance "a" WorldEnd"#, r#"one mirrors and the other does not"#),
        (r#"WorldBegin ActiveTransform EndTime Scale 1 1 -1 ›Shape "sphere" WorldEnd"#, r#"one mirrors and the other does not"#),
        (r#"›TransformTimes 2 1 WorldBegin WorldEnd"#, r#"do not ascend"#),
        (r#"ActiveTransform EndTime Scale 0 1 1 ›Camera "perspective" WorldBegin WorldEnd"#, r#"cannot be inverted"#),
    ];
    for (marked, words) in CASES {
        let (before, after) = marked.split_once('›').unwrap();
        let line = 1 + before.matches('\n').count() as u32;
        let column = 1 + before.chars().rev().take_while(|c| *c != '\n').count() as u32;
        let text = format!("{before}{after}").replace("NUL", "\0");
        let diagnostics = complaints(load_text(&text));
        assert_complains(&diagnostics, line, column, words);
        for diagnostic in &diagnostics {
            assert_eq!(diagnostic.severity, Severity::Error);
            // Formatting must work for any message.
            assert!(diagnostic.to_string().contains("error: "));
        }
    }
}

#[test]
fn every_mistake_of_a_file_is_reported_in_order() {
    let text = "Camera \"perspective\" \"string fov\" \"90\"\n\
        WorldBegin\n\
        Frobnicate 1 2 3 [ \"x\" ] Mumble All 5\n\
        \tShape \"sphere\" \"float radius\" [-1] \"float color\" 3\n\
        Material \"mate\"\n\
        AttributeEnd\n\
        WorldEnd\n";
    let diagnostics = complaints(load_text(text));
    let places: Vec<(u32, u32)> = diagnostics.iter().map(|d| (d.line, d.column)).collect();
    assert_eq!(
        places,
        [(1, 22), (3, 1), (3, 26), (4, 33), (4, 37), (5, 10), (6, 1)]
    );
}

#[test]
fn a_diagnostic_shows_the_line_and_points_at_the_token() {
    let (folder, result) = load_files(&[(
        "s.pbrt",
        "WorldBegin\n\tMaterial \"ü\"  # été\nWorldEnd".as_bytes(),
    )]);
    let Err(error) = result else { panic!() };
    let path = folder.path().join("s.pbrt");
    let expected = format!(
        "{}:2:11: error: unknown material \"ü\"\n    \tMaterial \"ü\"  # été\n    \t         ^^^\n    help: known: disney, fourier, glass, hair, kdsubsurface, matte, metal, mirror, mix, none, plastic, substrate, subsurface, translucent, uber",
        path.display()
    );
    assert_eq!(error.to_string(), expected);
}

#[test]
fn long_lines_are_cut_around_the_caret() {
    let zeros = "0 ".repeat(5000);
    let text = format!(
        "WorldBegin Shape \"trianglemesh\" \"point P\" [0 0 0] \"integer indices\" [{zeros} 0 7 {zeros}] WorldEnd"
    );
    let diagnostics = complaints(load_text(&text));
    assert_eq!(diagnostics.len(), 1);
    let d = &diagnostics[0];
    assert_eq!(d.column, 70 + 10_000 + 1 + 2);
    assert!(d.source_line.chars().count() < 150, "{}", d.source_line);
    let shown = d.to_string();
    let mut lines = shown.lines().skip(1);
    let (source, carets) = (lines.next().unwrap(), lines.next().unwrap());
    let caret = carets.find('^').unwrap();
    assert_eq!(source.chars().nth(caret), Some('7'));
}

#[test]
fn bytes_that_are_not_utf8_are_found_and_reading_goes_on() {
    let text = b"WorldBegin\n# caf\xE9\nMaterial \"m\xFFtte\" Shape \"cube\"\nWorldEnd\n";
    let diagnostics = complaints(load_files(&[("s.pbrt", text)]).1);
    assert_complains(&diagnostics, 2, 6, "byte 0xE9 is not UTF-8");
    assert_complains(&diagnostics, 3, 12, "byte 0xFF is not UTF-8");
    assert_complains(&diagnostics, 3, 24, "unknown shape \"cube\"");
}

#[test]
fn a_file_that_is_no_text_is_one_mistake() {
    let bytes: Vec<u8> = (0..3000_u32).map(|i| (i * i % 251) as u8).collect();
    let diagnostics = complaints(load_files(&[("s.pbrt", &bytes)]).1);
    assert_eq!(diagnostics.len(), 1, "{diagnostics:?}");
    assert_complains(&diagnostics, 1, 1, "the file is no text");
}

#[test]
fn kinds_that_are_not_supported_come_with_those_that_are() {
    let text = "Film \"rgb\"\nCamera \"realistic\"\nWorldBegin\n";
    let diagnostics = complaints(load_text(text));
    let camera = diagnostics.iter().find(|one| one.line == 2);
    let help = camera.and_then(|one| one.help.as_deref());
    let help = help.unwrap_or_default();
    assert_eq!(
        help,
        "supported: environment, orthographic, perspective, spherical"
    );
}

#[test]
fn a_broken_mesh_is_reported_where_it_is_named() {
    let ply = b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n\
property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
0 0 0\n3 0 0 9\n";
    let scene = b"WorldBegin\nShape \"plymesh\" \"string filename\" \"m.ply\"\nWorldEnd";
    let diagnostics = complaints(load_files(&[("s.pbrt", scene), ("m.ply", ply)]).1);
    assert_complains(
        &diagnostics,
        2,
        35,
        "\"m.ply\": line 11: face 0: vertex index 9 is not one of the 1 vertices",
    );
}

#[test]
fn many_mistakes_are_counted_beyond_the_first_hundred() {
    let text: String = (0..1000).map(|i| format!("Bad{i}\n")).collect();
    let Err(Error::Scene(diagnostics)) = load_text(&text) else {
        panic!()
    };
    assert_eq!(diagnostics.as_slice().len(), 100);
    // One more for the missing WorldBegin.
    assert_eq!(diagnostics.omitted(), 901);
    assert!(diagnostics.to_string().ends_with("and 901 more"));
}

#[test]
fn repeated_features_are_reported_once() {
    let shape = "Shape \"hyperboloid\" \"point p1\" [-1 0 -1] \"point p2\" [1 0 1]\n";
    let text = format!("WorldBegin\n{}WorldEnd", shape.repeat(50));
    let diagnostics = complaints(load_text(&text));
    assert_eq!(diagnostics.len(), 1);
    assert!(diagnostics[0].message.ends_with("(and 49 more like it)"));
}

#[test]
fn deep_blocks_are_bounded() {
    let text = format!(
        "WorldBegin\n{}{}WorldEnd",
        "AttributeBegin\n".repeat(50_000),
        "AttributeEnd\n".repeat(50_000)
    );
    let diagnostics = complaints(load_text(&text));
    assert_eq!(diagnostics.len(), 1, "{diagnostics:?}");
    assert_eq!(diagnostics[0].line, 10_002);
}

#[test]
fn a_scene_that_is_not_there_is_an_io_error() {
    let folder = tempfile::TempDir::new().unwrap();
    for path in [folder.path().join("no.pbrt"), folder.path().to_path_buf()] {
        match load(&path, &Options::default()) {
            Err(Error::Io { path: named, .. }) => assert_eq!(named, path),
            other => panic!("{other:?}"),
        }
    }
    assert_eq!(OPTIONS.orders.len(), 2);
}
