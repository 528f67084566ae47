//! Tests that `docs/src/pbrt-support.md` agrees with the lists in the code, and the lists with the reader.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::LazyLock;

use crate::{
    Error, Options, camera, directive, film, light, load, material, medium, settings, shape,
    texture,
};

/// Group of names of pbrt-v3.
struct Group {
    /// Heading of the table in the document.
    heading: &'static str,
    supported: Vec<&'static str>,
    unsupported: &'static [&'static str],
    /// Scene that uses `NAME`.
    scene: &'static str,
}

static GROUPS: LazyLock<Vec<Group>> = LazyLock::new(|| {
    vec![
        Group {
            heading: "Cameras",
            supported: camera::SUPPORTED.to_vec(),
            unsupported: &[],
            scene: r#"Camera "NAME" WorldBegin WorldEnd"#,
        },
        Group {
            heading: "Filters",
            supported: film::FILTERS.to_vec(),
            unsupported: &[],
            scene: r#"PixelFilter "NAME" WorldBegin WorldEnd"#,
        },
        Group {
            heading: "Samplers",
            supported: settings::SAMPLERS.to_vec(),
            unsupported: &[],
            scene: r#"Sampler "NAME" WorldBegin WorldEnd"#,
        },
        Group {
            heading: "Integrators",
            supported: settings::INTEGRATORS.to_vec(),
            unsupported: &[],
            scene: r#"Integrator "NAME" WorldBegin WorldEnd"#,
        },
        Group {
            heading: "Accelerators",
            supported: settings::ACCELERATORS.to_vec(),
            unsupported: &[],
            scene: r#"Accelerator "NAME" WorldBegin WorldEnd"#,
        },
        Group {
            heading: "Shapes",
            supported: shape::SUPPORTED.to_vec(),
            unsupported: &[],
            scene: r#"WorldBegin Shape "NAME" WorldEnd"#,
        },
        Group {
            heading: "Materials",
            supported: material::supported(),
            unsupported: &[],
            scene: r#"WorldBegin Material "NAME" WorldEnd"#,
        },
        Group {
            heading: "Materials of pbrt-v4",
            supported: material::version4::SUPPORTED.to_vec(),
            unsupported: material::version4::UNSUPPORTED,
            scene: r#"Film "rgb" WorldBegin Material "NAME""#,
        },
        Group {
            heading: "Shapes of pbrt-v4",
            supported: shape::SUPPORTED4.to_vec(),
            unsupported: &[],
            scene: r#"Film "rgb" WorldBegin Shape "NAME""#,
        },
        Group {
            heading: "Textures",
            supported: texture::SUPPORTED.to_vec(),
            unsupported: texture::UNSUPPORTED,
            scene: r#"WorldBegin Texture "t" "color" "NAME" Material "matte" "texture Kd" "t" WorldEnd"#,
        },
        Group {
            heading: "Mappings",
            supported: texture::MAPPINGS.to_vec(),
            unsupported: &[],
            scene: r#"WorldBegin Texture "t" "color" "bilerp" "string mapping" "NAME" WorldEnd"#,
        },
        Group {
            heading: "Lights",
            supported: light::supported(),
            unsupported: &[],
            scene: r#"WorldBegin LightSource "NAME" WorldEnd"#,
        },
        Group {
            heading: "Area lights",
            supported: light::SUPPORTED_AREA.to_vec(),
            unsupported: &[],
            scene: r#"WorldBegin AreaLightSource "NAME" WorldEnd"#,
        },
        Group {
            heading: "Media",
            supported: medium::SUPPORTED.to_vec(),
            unsupported: &[],
            scene: r#"WorldBegin MakeNamedMedium "m" "string type" "NAME" "float density" 1 WorldEnd"#,
        },
    ]
});

/// First two columns of every table by heading: names with their marks.
fn tables(text: &str) -> BTreeMap<&str, Vec<(&str, &str)>> {
    let mut tables = BTreeMap::new();
    let mut heading = "";
    for line in text.lines() {
        if let Some(title) = line.strip_prefix("## ") {
            heading = title;
        }
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        if let ["", name, mark, ..] = cells[..]
            && let Some(name) = name.strip_prefix('`').and_then(|n| n.strip_suffix('`'))
        {
            tables
                .entry(heading)
                .or_insert_with(Vec::new)
                .push((name, mark));
        }
    }
    tables
}

#[test]
fn the_document_lists_what_the_code_knows() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/src/pbrt-support.md");
    let text = std::fs::read_to_string(path).unwrap();
    let tables = tables(&text);
    let none: &[&str] = &[];
    let mut groups = vec![("Directives", directive::DIRECTIVES, none)];
    groups.extend(
        GROUPS
            .iter()
            .map(|g| (g.heading, &*g.supported, g.unsupported)),
    );
    for (heading, supported, unsupported) in &groups {
        let rows = tables
            .get(heading)
            .unwrap_or_else(|| panic!("no table {heading:?}"));
        for (name, mark) in rows {
            let known = ["read", "approximated", "left out", "error"];
            assert!(known.contains(mark), "{heading}: {name} is marked {mark:?}");
        }
        let marked = |is_error: bool| -> BTreeSet<&str> {
            let fits = |(_, mark): &&(&str, &str)| (*mark == "error") == is_error;
            rows.iter().filter(fits).map(|(name, _)| *name).collect()
        };
        let set = |names: &[&'static str]| -> BTreeSet<&str> { names.iter().copied().collect() };
        assert_eq!(marked(false), set(supported), "{heading}");
        assert_eq!(marked(true), set(unsupported), "{heading}");
    }
    // Tables without a list in the code.
    let others = ["Films", "Named spectra of pbrt-v4", "Scenes of pbrt-v4"];
    for heading in tables.keys() {
        let is_known = groups.iter().any(|group| group.0 == *heading);
        assert!(is_known || others.contains(heading), "{heading}");
    }
}

/// All messages about a scene.
fn messages(text: &str) -> String {
    let folder = tempfile::TempDir::new().unwrap();
    let path = folder.path().join("s.pbrt");
    std::fs::write(&path, text).unwrap();
    match load(&path, &Options::default()) {
        Ok(loaded) => loaded
            .notes
            .iter()
            .map(|note| note.message.as_str())
            .collect(),
        Err(Error::Scene(mistakes)) => mistakes.to_string(),
        Err(error) => panic!("{error}"),
    }
}

#[test]
fn the_reader_knows_what_is_listed() {
    for group in &*GROUPS {
        let said = |name: &str| messages(&group.scene.replace("NAME", name));
        for name in &group.supported {
            let said = said(name);
            let is_known = !said.contains("unknown") && !said.contains("not supported");
            assert!(is_known, "{}: {name}: {said}", group.heading);
        }
        for name in group.unsupported {
            let said = said(name);
            let words = "not supported yet";
            assert!(said.contains(words), "{}: {name}: {said}", group.heading);
        }
        let said = said("qzx");
        assert!(said.contains("unknown"), "{}: {said}", group.heading);
    }
}

/// Every named spectrum that the document lists is known, and none is missing.
#[test]
fn the_document_lists_the_spectra() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/src/pbrt-support.md");
    let text = std::fs::read_to_string(path).unwrap();
    let tables = tables(&text);
    let rows = &tables["Named spectra of pbrt-v4"];
    let listed: BTreeSet<&str> = rows.iter().map(|(name, _)| *name).collect();
    let known = crate::named_spectra::names();
    let known: BTreeSet<&str> = known.iter().map(String::as_str).collect();
    assert_eq!(listed, known);
}
