//! Limits: scenes that demand too much are refused at the place of the demand.

use antumbra_pbrt::{Error, Loaded, Options, load, load_ply, load_ply_within};

use super::{complaints, load_text, world};

/// Reads a scene that includes a file of the given text `times` times, within a limit of memory.
fn repeated(text: &str, times: usize, max_memory: u64) -> Result<Loaded, Error> {
    let folder = tempfile::TempDir::new().unwrap();
    let include = "Include \"part.pbrt\"\n".repeat(times);
    let main = folder.path().join("scene.pbrt");
    std::fs::write(&main, format!("WorldBegin\n{include}WorldEnd\n")).unwrap();
    std::fs::write(folder.path().join("part.pbrt"), text).unwrap();
    std::fs::write(folder.path().join("m.ply"), mesh(1000)).unwrap();
    let options = Options {
        max_memory: Some(max_memory),
        ..Options::default()
    };
    load(&main, &options)
}

/// Fan of triangles with about 30 bytes each.
fn mesh(triangles: usize) -> String {
    let vertices: String = (0..triangles + 2).map(|i| format!("{i} 0 1\n")).collect();
    let faces: String = (0..triangles)
        .map(|i| format!("3 0 {} {}\n", i + 1, i + 2))
        .collect();
    format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {triangles}\nproperty list uchar int vertex_indices\nend_header\n{vertices}{faces}",
        triangles + 2
    )
}

#[test]
fn shapes_instances_and_meshes_stay_within_the_memory_allowed() {
    let sphere = "Shape \"sphere\" \"float zmax\" .5\n";
    let instances = "ObjectBegin \"o\" Shape \"sphere\" ObjectEnd\n".to_owned()
        + &"ObjectInstance \"o\"\n".repeat(100);
    let light = "LightSource \"point\"\n".repeat(100);
    for (text, times) in [(sphere, 100), (&instances, 20), (&light, 20)] {
        assert!(repeated(text, times, u64::MAX).is_ok());
        let diagnostics = complaints(repeated(text, times, 100_000));
        assert_eq!(diagnostics.len(), 1, "{diagnostics:?}");
        let message = &diagnostics[0].message;
        assert!(message.contains("needs more memory"), "{message}");
        assert!(message.contains("of 100000"), "{message}");
        assert!(diagnostics[0].file.ends_with("part.pbrt"));
        assert!(diagnostics[0].line >= 1);
    }
    // Repeated files share one mesh. Under another transformation the mesh is a new one.
    let mesh = "Shape \"plymesh\" \"string filename\" \"m.ply\"\n";
    assert!(repeated(mesh, 100, 150_000).is_ok());
    let moved = mesh.to_owned() + "Translate 1 0 0\n";
    let diagnostics = complaints(repeated(&moved, 100, 150_000));
    assert_eq!(diagnostics.len(), 1, "{diagnostics:?}");
    assert_eq!(diagnostics[0].line, 1);
}

/// What follows a refusal by memory is not read: a mistake there is not reported.
#[test]
fn reading_ends_at_a_refusal_by_memory() {
    let text = "LightSource \"point\"\n".repeat(1000) + "Nonsense\n";
    let diagnostics = complaints(repeated(&text, 1000, 100_000));
    assert_eq!(diagnostics.len(), 1, "{diagnostics:?}");
    // Texts stay in memory, so they count.
    let comment = format!("#{}\n", "x".repeat(200_000));
    assert!(repeated(&comment, 10, 300_000).is_ok());
    let diagnostics = complaints(repeated(&comment, 10, 100_000));
    assert_eq!(diagnostics.len(), 1, "{diagnostics:?}");
    assert_eq!(diagnostics[0].line, 2);
    assert!(
        diagnostics[0].message.contains("may take only"),
        "{diagnostics:?}"
    );
}

/// Files that are included again, whatever is in them, end somewhere.
#[test]
fn texts_that_are_read_again_are_limited() {
    let comment = format!("#{}\n", "x".repeat(64 << 20));
    let diagnostics = complaints(repeated(&comment, 90_000, u64::MAX));
    assert_eq!(diagnostics.len(), 1, "{diagnostics:?}");
    assert_eq!(diagnostics[0].line, 66);
    assert!(
        diagnostics[0].message.contains("included again"),
        "{diagnostics:?}"
    );
}

/// A huge file that is no mesh is refused by its first bytes, and a mesh by the counts in its header.
#[test]
fn meshes_are_looked_at_before_they_are_read() {
    let folder = tempfile::TempDir::new().unwrap();
    let path = folder.path().join("m.ply");
    let file = std::fs::File::create(&path).unwrap();
    file.set_len(1 << 40).unwrap();
    let error = load_ply(&path).unwrap_err().to_string();
    assert!(error.contains("the file is not a PLY file"), "{error}");
    std::fs::write(&path, mesh(1000)).unwrap();
    assert!(load_ply_within(&path, 100_000).is_ok());
    let error = load_ply_within(&path, 60_000).unwrap_err().to_string();
    assert!(error.contains("the mesh needs 56064 bytes"), "{error}");
    let error = load_ply_within(&path, 10_000).unwrap_err().to_string();
    assert!(error.contains("the limit is 10000 bytes"), "{error}");
}

#[test]
fn samples_have_limits() {
    for (options, value, text) in [
        (
            "Sampler \"halton\" \"integer pixelsamples\" 2147483647",
            2147483647u32,
            "at most 1048576",
        ),
        (
            "Sampler \"random\" \"integer pixelsamples\" 1048577",
            1048577,
            "at most 1048576",
        ),
        (
            "Sampler \"random\" \"integer pixelsamples\" -1",
            0,
            "at least 1, found -1",
        ),
        (
            "Sampler \"stratified\" \"integer xsamples\" 65536 \"integer ysamples\" 17",
            65536,
            "more than 1048576",
        ),
        (
            "Integrator \"ambientocclusion\" \"integer nsamples\" 1073741824",
            1073741824,
            "at most 1048576",
        ),
    ] {
        let diagnostics = complaints(load_text(&format!("{options} WorldBegin WorldEnd")));
        assert_eq!(diagnostics.len(), 1, "{options}");
        let message = &diagnostics[0].message;
        assert!(message.contains(text), "{message}");
        assert!(
            value == 0 || message.contains(&value.to_string()),
            "{message}"
        );
    }
    let lights = "LightSource \"infinite\" \"integer samples\" 1048577";
    let diagnostics = complaints(load_text(&format!("WorldBegin {lights} WorldEnd")));
    assert!(diagnostics[0].message.contains("at most 1048576"));
    assert_eq!(diagnostics[0].column, 53);
}

/// Input that was reported to crash pbrt-v3 (issue 160): filters of zero and of huge width, and a very long file name.
#[test]
fn scenes_that_crash_others_are_refused_or_read() {
    let filter = "PixelFilter \"mitchell\" \"float xwidth\" [0] \"float ywidth\" [2147483300]";
    let diagnostics = complaints(load_text(&format!("{filter}\nWorldBegin\nWorldEnd\n")));
    assert_eq!(diagnostics.len(), 2, "{diagnostics:?}");
    let name = "C".repeat(100_000);
    let film = format!("Film \"image\" \"string filename\" [\"{name}\"]");
    let loaded = load_text(&format!("{film}\nWorldBegin\nWorldEnd\n")).expect("a long name");
    assert_eq!(
        loaded.scene.film.file_name.as_ref().map(String::len),
        Some(100_000)
    );
}

/// Search for advice, whose time grows with the number of names.
///
/// If the search ran for every mistake, a file of some hundred kilobytes would take hours.
#[test]
fn many_unknown_names_among_many_known_ones_are_refused_in_time() {
    let count = 4_000;
    let named = |directive: &str| -> String {
        (0..count)
            .map(|i| directive.replace('?', &format!("a name of thirty letters {i}")))
            .collect()
    };
    for (known, unknown) in [
        (
            "MakeNamedMaterial \"?\" \"string type\" \"matte\"\n",
            "NamedMaterial \"?x\"\n",
        ),
        (
            "MakeNamedMaterial \"?\" \"string type\" \"matte\"\n",
            "Material \"mix\" \"string namedmaterial1\" \"?x\" \"string namedmaterial2\" \"?x\" Shape \"disk\"\n",
        ),
        ("CoordinateSystem \"?\"\n", "CoordSysTransform \"?x\"\n"),
        ("ObjectBegin \"?\" ObjectEnd\n", "ObjectInstance \"?x\"\n"),
        (
            "Texture \"?\" \"spectrum\" \"constant\"\n",
            "Material \"matte\" \"texture Kd\" \"?x\"\n",
        ),
    ] {
        let text = format!("WorldBegin\n{}{}WorldEnd\n", named(known), named(unknown));
        let Err(Error::Scene(diagnostics)) = load_text(&text) else {
            panic!("{unknown} is accepted");
        };
        assert_eq!(diagnostics.as_slice().len(), 100);
        assert!(
            diagnostics.omitted() >= count - 100,
            "{unknown} {}",
            diagnostics.omitted()
        );
        if unknown.contains("aterial \"?x\"") || unknown.contains("mix") {
            let (_, warnings) = crate::tolerated(&text);
            assert_eq!(warnings.len(), 100);
        }
    }
}

/// Textures and materials with two parts each, whose number doubles at every level.
#[test]
fn textures_and_materials_that_double_are_refused_in_time() {
    let levels = 60;
    let textures: String = (1..levels)
        .map(|i| {
            let last = i - 1;
            format!(
                "Texture \"t{i}\" \"spectrum\" \"scale\" \"texture tex1\" \"t{last}\" \"texture tex2\" \"t{last}\"\n"
            )
        })
        .collect();
    let materials: String = (1..levels)
        .map(|i| {
            let last = i - 1;
            format!(
                "MakeNamedMaterial \"m{i}\" \"string type\" \"mix\" \"string namedmaterial1\" \"m{last}\" \
                 \"string namedmaterial2\" \"m{last}\"\n"
            )
        })
        .collect();
    for text in [
        format!(
            "Texture \"t0\" \"spectrum\" \"bilerp\"\n{textures}Material \"matte\" \"texture Kd\" \"t59\"\n"
        ),
        format!(
            "MakeNamedMaterial \"m0\" \"string type\" \"matte\"\n{materials}NamedMaterial \"m59\"\n"
        ),
    ] {
        let text = format!("WorldBegin\n{text}Shape \"disk\"\nWorldEnd\n");
        let diagnostics = complaints(load_text(&text));
        let message = &diagnostics[0].message;
        assert!(message.contains("made of more than 4096"), "{message}");
    }
}

/// Chains as long as the file, on which recursion would overflow the stack.
#[test]
fn textures_and_materials_in_long_chains_are_refused() {
    let texture = "Texture \"t\" \"float\" \"scale\" \"texture tex1\" \"t\"\n".repeat(50_000);
    let material = "MakeNamedMaterial \"m\" \"string type\" \"mix\" \"string namedmaterial1\" \"m\" \
                    \"string namedmaterial2\" \"n\"\n";
    let material = material.repeat(10_000);
    for text in [
        format!("Texture \"t\" \"float\" \"bilerp\"\n{texture}"),
        format!(
            "MakeNamedMaterial \"m\" \"string type\" \"matte\"\n\
             MakeNamedMaterial \"n\" \"string type\" \"matte\"\n{material}"
        ),
    ] {
        let diagnostics = complaints(load_text(&format!("WorldBegin\n{text}WorldEnd\n")));
        let message = &diagnostics[0].message;
        assert!(message.contains("made of more than 4096"), "{message}");
    }
}

#[test]
fn curves_have_a_limit_of_segments() {
    let curve = |segments: usize| {
        let points = "0 0 0 1 1 0 2 0 0 ".repeat(segments);
        format!("WorldBegin Shape \"curve\" \"point P\" [{points} 9 9 9] WorldEnd")
    };
    assert!(load_text(&curve(100)).is_ok());
    let diagnostics = complaints(load_text(&curve(16385)));
    assert!(
        diagnostics[0].message.contains("found 16385"),
        "{}",
        diagnostics[0]
    );
}

#[test]
fn long_lists_and_deep_blocks_are_read() {
    let values = "0 0 0 ".repeat(100_000);
    let scene = world(&format!(
        "Shape \"trianglemesh\" \"point P\" [{values}] \"integer indices\" [0 1 99999]"
    ));
    assert_eq!(scene.shapes.len(), 1);
    let (begin, end) = ("AttributeBegin ", "AttributeEnd ");
    let depth = 10_000;
    world(&(begin.repeat(depth) + &end.repeat(depth)));
    let deeper = begin.repeat(depth + 1) + &end.repeat(depth + 1);
    let diagnostics = complaints(load_text(&format!("WorldBegin {deeper} WorldEnd")));
    assert_eq!(diagnostics.len(), 1);
    let message = &diagnostics[0].message;
    assert!(message.contains("more than 10000 deep"), "{message}");
}

#[test]
fn long_paths_are_refused_by_the_system() {
    let name = "x/".repeat(100_000);
    for directive in [
        format!("Include \"{name}\""),
        format!("Shape \"plymesh\" \"string filename\" \"{name}.ply\""),
        format!("Texture \"t\" \"float\" \"imagemap\" \"string filename\" \"{name}.png\""),
    ] {
        let diagnostics = complaints(load_text(&format!("WorldBegin {directive} WorldEnd")));
        assert_eq!(diagnostics.len(), 1, "{diagnostics:?}");
    }
}
