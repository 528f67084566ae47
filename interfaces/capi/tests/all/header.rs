//! The header declares what the library has: functions, structures, numbers.

use std::collections::BTreeSet;
use std::fmt::Write;
use std::mem::offset_of;
use std::process::Command;

use crate::support::{Language, build, here, run, static_library};
use antumbra::{Hit, PrimId, Ray};
use antumbra_capi::batch::BatchOptions;
use antumbra_capi::build::BuildOptions;
use antumbra_capi::functions::{
    Box3, FunctionLists, OpacityFunction, Point, UserFunctions, UserHit3,
};
use antumbra_capi::groups::GroupOptions;
use antumbra_capi::points::{Near, PointOptions};
use antumbra_capi::recipe::RecipeChoices;
use antumbra_capi::single::Surface;
use antumbra_capi::status::Status;
use antumbra_capi::tree::Report;
use antumbra_capi::world::Placed;

fn header() -> String {
    let text = std::fs::read_to_string(here().join("include/antumbra.h")).expect("the header");
    without_comments(&text)
}

fn without_comments(text: &str) -> String {
    let mut parts = text.split("/*");
    let mut code = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        code += part.split_once("*/").expect("comments end").1;
    }
    code
}

/// Words of a text: letters, digits and underscores.
fn words(text: &str) -> impl Iterator<Item = &str> {
    text.split(|c: char| !(c.is_alphanumeric() || c == '_'))
        .filter(|word| !word.is_empty())
}

/// Names of functions that the header declares.
fn declared() -> BTreeSet<String> {
    let header = header();
    let declarations = header.split("ANTUMBRA_API ").skip(1);
    let name = |text: &str| {
        let (before, _) = text.split_once('(').expect("parameters");
        words(before).last().expect("a name").to_owned()
    };
    let names = declarations.filter(|text| text.contains('(')).map(name);
    // Not the macro itself.
    names.filter(|name| name.starts_with("antumbra_")).collect()
}

/// Names of functions that the sources export: those of the list, and the few that are written out.
fn defined() -> BTreeSet<String> {
    let mut names: BTreeSet<_> = listed().into_iter().map(|function| function.name).collect();
    for text in sources() {
        let written = text
            .split("\npub extern \"C\" fn ")
            .chain(text.split("\npub unsafe extern \"C\" fn "));
        names.extend(
            written
                .filter_map(|rest| Some(rest.split_once('(')?.0.to_owned()))
                .filter(|name| name.starts_with("antumbra_") && !name.contains(' ')),
        );
    }
    names
}

/// Texts of the sources.
fn sources() -> impl Iterator<Item = String> {
    let files = std::fs::read_dir(here().join("src")).expect("sources");
    files.map(|file| std::fs::read_to_string(file.expect("a file").path()).expect("text"))
}

#[test]
fn functions_are_declared_and_defined() {
    let (declared, defined) = (declared(), defined());
    assert!(declared.len() > 60, "{declared:?}");
    let missing: Vec<_> = declared.difference(&defined).collect();
    assert!(missing.is_empty(), "declared and not defined: {missing:?}");
    let missing: Vec<_> = defined.difference(&declared).collect();
    assert!(missing.is_empty(), "defined and not declared: {missing:?}");
}

/// What the shared library exports, if there is `nm` and a library.
#[test]
fn the_library_exports_what_is_declared() {
    let library = static_library().with_file_name("libantumbra_capi.so");
    let Ok(symbols) = Command::new("nm")
        .args(["-D", "--defined-only"])
        .arg(&library)
        .output()
    else {
        println!("skipped: no nm");
        return;
    };
    if !symbols.status.success() {
        println!("skipped: no {}", library.display());
        return;
    }
    let symbols = String::from_utf8_lossy(&symbols.stdout).into_owned();
    let exported: BTreeSet<_> = (symbols.lines())
        .filter_map(|line| line.rsplit(' ').next())
        .filter(|name| name.starts_with("antumbra_"))
        .map(str::to_owned)
        .collect();
    assert_eq!(exported, declared());
}

/// Name in C, size, alignment, and the places of all fields.
type Layout = (&'static str, usize, usize, Vec<(&'static str, usize)>);

macro_rules! layouts {
    ($($name:literal $Type:ty { $($field:ident $(as $c:literal)?),* $(,)? })*) => {
        vec![$((
            $name,
            size_of::<$Type>(),
            align_of::<$Type>(),
            vec![$((layouts!(@name $field $($c)?), offset_of!($Type, $field))),*],
        )),*]
    };
    (@name $field:ident) => { stringify!($field) };
    (@name $field:ident $c:literal) => { $c };
}

fn layouts() -> Vec<Layout> {
    layouts! {
        "antumbra_ray" Ray { org, tnear, dir, tfar }
        "antumbra_hit" Hit { t, u, v, prim_id, geom_id, inst_id }
        "antumbra_prim_id" PrimId { inst_id, geom_id, prim_id }
        "antumbra_surface" Surface { hit, position, normal }
        "antumbra_box" Box3 { min, max }
        "antumbra_user_hit" UserHit3 { t, u, v }
        "antumbra_user_geometry" UserFunctions {
            size, data, bounds, intersect, occluded, closest_point, normal, release,
        }
        "antumbra_candidate" Point { u, v, id, is_occlusion }
        "antumbra_opacity" OpacityFunction { size, data, opacity, release }
        "antumbra_functions" FunctionLists {
            size, user_geometries, user_geometry_count, opacities, opacity_count,
        }
        "antumbra_recipe" RecipeChoices {
            size, preset, builder, collapse, order, level, width, training, surface_rays, seed, node_cost, prim_cost,
            entry_cost, cutout_cost, prefetch, reserved,
        }
        "antumbra_build" BuildOptions {
            size, recipe, rays, ray_count, ray_stride, data, progress, cancelled, threads,
        }
        "antumbra_instance" Placed { object, mask, transform }
        "antumbra_report" Report {
            size, primitives, cutouts, instances, objects, dropped, transparent, nodes, leaves, depth, bytes, training_rays,
            sah, width, prefetches, level,
        }
        "antumbra_batch" BatchOptions {
            size, count, rays, ray_stride, origins, origin_stride, directions, direction_stride, tnear, tnear_stride, tfar,
            tfar_stride, masks, mask_stride, except, except_stride, data, filter, flags, order, threads,
        }
        "antumbra_group" GroupOptions {
            size, count, points, point_stride, normals, normal_stride, tnear, tnear_stride, tfar, flags, threads,
        }
        "antumbra_points" PointOptions {
            size, count, points, point_stride, max_distances, max_distance_stride, flags, reserved, threads,
        }
        "antumbra_closest_point" Near { distance, position, u, v, prim_id, geom_id, inst_id }
    }
}

/// Structures of the header with the names of their fields.
fn structures() -> Vec<(String, Vec<String>)> {
    let header = header();
    let field = |line: &str| {
        // A pointer to a function has its name in the first parentheses, an array before the bracket.
        let name = match line.split_once("(*") {
            Some((_, rest)) => words(rest).next(),
            None => words(line.split('[').next().unwrap_or_default()).last(),
        };
        name.expect("a name").to_owned()
    };
    (header.split("typedef struct ").skip(1))
        .filter(|text| text.find('{') < text.find(';') && text.contains('{'))
        .map(|text| {
            let (name, rest) = text.split_once('{').expect("fields");
            let (fields, _) = rest.split_once('}').expect("an end");
            let fields = fields.split(';').filter(|line| !line.trim().is_empty());
            (name.trim().to_owned(), fields.map(field).collect())
        })
        .collect()
}

#[test]
fn structures_have_the_same_layout() {
    let layouts = layouts();
    let ours: Vec<(String, Vec<String>)> = (layouts.iter())
        .map(|(name, _, _, fields)| {
            let fields = fields.iter().map(|(field, _)| (*field).to_owned());
            ((*name).to_owned(), fields.collect())
        })
        .collect();
    let sorted = |mut list: Vec<_>| {
        list.sort();
        list
    };
    assert_eq!(
        sorted(structures()),
        sorted(ours),
        "names of structures and fields"
    );

    // The compiler of C has the last word.
    let mut source =
        String::from("#include \"antumbra.h\"\n#include <stdio.h>\nint main(void) {\n");
    let mut expected = String::new();
    for (name, size, _, fields) in layouts {
        writeln!(source, "printf(\"{name} %zu\\n\", sizeof({name}));").expect("memory");
        writeln!(expected, "{name} {size}").expect("memory");
        for (field, offset) in fields {
            writeln!(
                source,
                "printf(\"{name}.{field} %zu\\n\", offsetof({name}, {field}));"
            )
            .expect("memory");
            writeln!(expected, "{name}.{field} {offset}").expect("memory");
        }
    }
    source += "return 0;\n}\n";
    let folder = tempfile::tempdir().expect("a folder");
    let (file, program) = (
        folder.path().join("layouts.c"),
        folder.path().join("layouts"),
    );
    std::fs::write(&file, source).expect("written");
    if build(Language::C99, &file, &program, &[]).is_some() {
        assert_eq!(run(&mut Command::new(program)), expected);
    }
}

#[test]
fn numbers_are_the_same() {
    let header = header();
    let value = |name: &str| -> i64 {
        let (_, rest) = header
            .split_once(&format!("{name} = "))
            .unwrap_or_else(|| panic!("{name}"));
        words(rest)
            .next()
            .expect("a number")
            .parse()
            .expect("a number")
    };
    for status in Status::ALL {
        let name: String = format!("{status:?}")
            .chars()
            .fold(String::new(), |mut name, c| {
                if c.is_uppercase() {
                    name.push('_');
                }
                name.push(c.to_ascii_uppercase());
                name
            });
        assert_eq!(value(&format!("ANTUMBRA{name}")), i64::from(status as i32));
    }
    assert_eq!(
        value("ANTUMBRA_CLOSED"),
        i64::from(antumbra_capi::batch::CLOSED)
    );
    assert_eq!(
        value("ANTUMBRA_THIS_THREAD"),
        i64::from(antumbra_capi::batch::THIS_THREAD)
    );
    let version: Vec<_> = ["MAJOR", "MINOR", "PATCH"]
        .map(|part| {
            let (_, rest) = header
                .split_once(&format!("ANTUMBRA_VERSION_{part} "))
                .expect("a version");
            words(rest).next().expect("a number").to_owned()
        })
        .into();
    assert_eq!(version.join("."), env!("CARGO_PKG_VERSION"));
}

/// A function of the list in the sources: its documentation, and the types of Rust of its parameters.
struct Listed {
    name: String,
    docs: Vec<String>,
    parameters: Vec<(String, String)>,
    is_free: bool,
}

/// Functions that stand under `functions!` and `frees!`.
fn listed() -> Vec<Listed> {
    let mut all = Vec::new();
    for text in sources() {
        for (opening, is_free) in [("\nfunctions! {\n", false), ("\nfrees! {\n", true)] {
            let Some((_, block)) = text.split_once(opening) else {
                continue;
            };
            let (block, _) = block.split_once("\n}\n").expect("an end");
            let mut docs = Vec::new();
            let mut lines = block.lines();
            while let Some(line) = lines.next() {
                if let Some(doc) = line.strip_prefix("    ///") {
                    docs.push(doc.trim_start().to_owned());
                } else if let Some(first) = line.strip_prefix("    fn ") {
                    let mut signature = first.to_owned();
                    while !signature.ends_with(['{', ';']) {
                        signature += lines.next().expect("parameters").trim();
                        signature.push(' ');
                        signature = signature.trim_end().to_owned();
                    }
                    all.push(function(&signature, std::mem::take(&mut docs), is_free));
                }
            }
        }
    }
    all
}

fn function(signature: &str, docs: Vec<String>, is_free: bool) -> Listed {
    let (name, rest) = signature.split_once('(').expect("parameters");
    let (parameters, _) = rest.rsplit_once(')').expect("parameters");
    // No type of the list has a comma.
    let parameters = parameters.split(',').filter_map(|part| {
        let (name, kind) = part.split_once(':')?;
        Some((name.trim().to_owned(), kind.trim().to_owned()))
    });
    Listed {
        name: name.to_owned(),
        docs,
        parameters: parameters.collect(),
        is_free,
    }
}

/// Name in C of a type of Rust.
fn in_c(name: &str) -> String {
    let known = match name {
        "u8" | "u32" | "u64" | "i32" => {
            return format!("{}int{}_t", &name[..1].replace('i', ""), &name[1..]);
        }
        "usize" => "size_t",
        "f32" => "float",
        "f64" => "double",
        "bool" => "bool",
        "c_char" => "char",
        "c_void" => "void",
        "OwnObject" => "antumbra_object",
        "OwnWorld" => "antumbra_world",
        "Placed" => "antumbra_instance",
        "Near" => "antumbra_closest_point",
        "NearLists" => "antumbra_closest_lists",
        "Box3" => "antumbra_box",
        "UserFunctions" => "antumbra_user_geometry",
        "OpacityFunction" => "antumbra_opacity",
        "RecipeChoices" => "antumbra_recipe",
        _ => {
            let mut snake = String::from("antumbra");
            for c in name.chars() {
                if c.is_uppercase() {
                    snake.push('_');
                }
                snake.push(c.to_ascii_lowercase());
            }
            return snake;
        }
    };
    known.to_owned()
}

/// A parameter as C declares it.
fn declaration(name: &str, kind: &str) -> String {
    let inner = |open: &str| {
        kind.strip_prefix(open)
            .and_then(|kind| kind.strip_suffix('>'))
    };
    let pointer = |before: &str, kind: &str, after: &str| {
        let (before, kind) = match kind.strip_prefix("*const ") {
            Some(kind) => ("const ", kind),
            None => (before, kind),
        };
        format!("{before}{} {after}{name}", in_c(kind))
    };
    match kind {
        "Place<'_>" => pointer("const ", "Threads", "*"),
        "Prepared<'_>" => pointer("const ", "Build", "*"),
        "Given" => pointer("const ", "Functions", "*"),
        "Recipe" => pointer("const ", "Recipe", "*"),
        "Rays<'_>" => pointer("const ", "Batch", "*"),
        "FilePath<'_>" => pointer("const ", "c_char", "*"),
        "Option<OnHit>" => {
            format!("int32_t (*{name})(void *data, size_t ray, const antumbra_hit *hit)")
        }
        "Points<'_>" => pointer(
            "const ",
            if name == "group" { "Group" } else { "Points" },
            "*",
        ),
        _ => {
            if let Some(kind) = inner("Option<Handle<").and_then(|kind| kind.strip_suffix('>')) {
                pointer("", kind, "**")
            } else if let Some(kind) = inner("Handle<") {
                pointer("", kind, "**")
            } else if let Some(kind) = inner("Slot<").or(inner("MaybeSlot<")) {
                let stars = if kind.starts_with('*') { "**" } else { "*" };
                pointer("", kind, stars)
            } else if let Some(kind) = kind.strip_prefix("&mut ").or(kind.strip_prefix("*mut ")) {
                pointer("", kind, "*")
            } else if let Some(kind) = kind.strip_prefix("*const *const ") {
                pointer("const ", kind, "*const *")
            } else if let Some(kind) =
                (kind.strip_prefix('&').or(kind.strip_prefix("*const "))).or(inner("Option<&"))
            {
                pointer("const ", kind, "*")
            } else {
                format!("{} {name}", in_c(kind))
            }
        }
    }
}

/// Widest line of a declaration.
const WIDTH: usize = 129;

impl Listed {
    fn returns(&self) -> &'static str {
        match self.is_free {
            true => "void",
            false => "antumbra_status",
        }
    }

    fn prototype(&self) -> String {
        let mut text = format!("ANTUMBRA_API {} {}(", self.returns(), self.name);
        let indent = text.len();
        let mut column = indent;
        let count = self.parameters.len();
        for (index, (name, kind)) in self.parameters.iter().enumerate() {
            let kind = if self.is_free {
                format!("&mut {kind}")
            } else {
                kind.clone()
            };
            let end = if index + 1 == count { ");" } else { "," };
            let part = declaration(name, &kind) + end;
            if index > 0 {
                if column + 1 + part.len() > WIDTH {
                    text += &format!("\n{}", " ".repeat(indent));
                    column = indent;
                } else {
                    text.push(' ');
                    column += 1;
                }
            }
            column += part.len();
            text += &part;
        }
        text
    }

    fn comment(&self) -> String {
        let mut text = String::from("/*");
        for (index, line) in self.docs.iter().enumerate() {
            let begin = if index == 0 { " " } else { "\n * " };
            text += (begin.to_owned() + line).trim_end_matches(' ');
        }
        text + " */\n"
    }
}

/// The header with the declarations that the sources say. Text between them stays.
fn written(header: &str) -> String {
    let mut text = header.to_owned();
    for function in listed() {
        let line = format!("\nANTUMBRA_API {} {}(", function.returns(), function.name);
        let place = text.find(&line);
        let begin = place.unwrap_or_else(|| panic!("add{line}); to the header")) + 1;
        let end = begin + text[begin..].find(';').expect("an end") + 1;
        // Of declarations that share a comment, the first has it.
        let (begin, comment) = match text[..begin].ends_with("*/\n") {
            true => (
                text[..begin].rfind("/*").expect("a comment"),
                function.comment(),
            ),
            false => (begin, String::new()),
        };
        text.replace_range(begin..end, &(comment + &function.prototype()));
    }
    text
}

/// `ANTUMBRA_WRITE=1 cargo test -p antumbra-capi declarations` writes them anew.
#[test]
fn declarations_are_written_from_the_sources() {
    let path = here().join("include/antumbra.h");
    let header = std::fs::read_to_string(&path).expect("the header");
    let written = written(&header);
    if std::env::var_os("ANTUMBRA_WRITE").is_some() {
        std::fs::write(&path, written).expect("written");
        return;
    }
    let differs = header.lines().zip(written.lines()).find(|(a, b)| a != b);
    assert!(
        header == written,
        "the sources say another header, at {differs:?}: run ANTUMBRA_WRITE=1 cargo test -p antumbra-capi declarations"
    );
}
