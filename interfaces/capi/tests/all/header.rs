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

/// Names of functions that the sources export. Those that macros make are found by the uses of these.
fn defined() -> BTreeSet<String> {
    let mut names = BTreeSet::new();
    for file in std::fs::read_dir(here().join("src")).expect("sources") {
        let text = std::fs::read_to_string(file.expect("a file").path()).expect("text");
        let code: String = text
            .lines()
            .filter(|line| !line.trim_start().starts_with("//"))
            .fold(String::new(), |all, line| all + line + "\n");
        for (place, _) in code.match_indices("antumbra_") {
            // A definition, or the name in the use of a macro.
            let before = code[..place].trim_end();
            let name = words(&code[place..]).next().expect("a name");
            let after = code[place + name.len()..].trim_start();
            let is_definition = before.ends_with(" fn") && after.starts_with('(');
            let is_use = before.ends_with("!(")
                || (before.ends_with(',') && (after.starts_with(',') || after.starts_with(')')));
            if is_definition || is_use {
                names.insert(name.to_owned());
            }
        }
    }
    names
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
