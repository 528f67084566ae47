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

impl Group {
    fn new(heading: &'static str, supported: &[&'static str], scene: &'static str) -> Self {
        Self {
            heading,
            supported: supported.to_vec(),
            unsupported: &[],
            scene,
        }
    }

    fn without(mut self, unsupported: &'static [&'static str]) -> Self {
        self.unsupported = unsupported;
        self
    }
}

static GROUPS: LazyLock<Vec<Group>> = LazyLock::new(|| {
    vec![
        Group::new(
            "Cameras",
            camera::SUPPORTED,
            r#"Camera "NAME" WorldBegin WorldEnd"#,
        ),
        Group::new(
            "Filters",
            film::FILTERS,
            r#"PixelFilter "NAME" WorldBegin WorldEnd"#,
        ),
        Group::new(
            "Samplers",
            settings::SAMPLERS,
            r#"Sampler "NAME" WorldBegin WorldEnd"#,
        ),
        Group::new(
            "Integrators",
            settings::INTEGRATORS,
            r#"Integrator "NAME" WorldBegin WorldEnd"#,
        ),
        Group::new(
            "Accelerators",
            settings::ACCELERATORS,
            r#"Accelerator "NAME" WorldBegin WorldEnd"#,
        ),
        Group::new(
            "Shapes",
            shape::SUPPORTED,
            r#"WorldBegin Shape "NAME" WorldEnd"#,
        ),
        Group::new(
            "Materials",
            &material::supported(),
            r#"WorldBegin Material "NAME" WorldEnd"#,
        ),
        Group::new(
            "Materials of pbrt-v4",
            material::version4::SUPPORTED,
            r#"Film "rgb" WorldBegin Material "NAME""#,
        )
        .without(material::version4::UNSUPPORTED),
        Group::new(
            "Shapes of pbrt-v4",
            shape::SUPPORTED4,
            r#"Film "rgb" WorldBegin Shape "NAME""#,
        ),
        Group::new(
            "Textures",
            texture::SUPPORTED,
            r#"WorldBegin Texture "t" "color" "NAME" Material "matte" "texture Kd" "t" WorldEnd"#,
        )
        .without(texture::UNSUPPORTED),
        Group::new(
            "Mappings",
            texture::MAPPINGS,
            r#"WorldBegin Texture "t" "color" "bilerp" "string mapping" "NAME" WorldEnd"#,
        ),
        Group::new(
            "Lights",
            &light::supported(),
            r#"WorldBegin LightSource "NAME" WorldEnd"#,
        ),
        Group::new(
            "Area lights",
            light::SUPPORTED_AREA,
            r#"WorldBegin AreaLightSource "NAME" WorldEnd"#,
        ),
        Group::new(
            "Media",
            medium::SUPPORTED,
            r#"WorldBegin MakeNamedMedium "m" "string type" "NAME" "float density" 1 WorldEnd"#,
        ),
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
