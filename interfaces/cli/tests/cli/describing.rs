//! `info`.

use crate::support::Place;

#[test]
fn what_is_in_a_scene_and_its_trees() {
    let place = Place::with_room();
    let document = place
        .run(&["info", "room.pbrt", "--json", "-"])
        .expect(0)
        .json();
    assert_eq!(document["schema"], "antumbra.info/1");
    for field in ["version", "cpu", "level", "threads", "command_line"] {
        assert!(document.get(field).is_some(), "{field}");
    }
    assert!(document.get("seed").is_none());
    assert_eq!(document["shapes"], 4);
    assert_eq!(document["triangles"], 12);
    assert_eq!(document["spheres"], 1);
    assert_eq!(document["objects"], 0);
    assert_eq!(document["stored_triangles"], 12);
    assert_eq!(document["lights"]["infinite"], 1);
    assert_eq!(document["lights"]["area"], 1);
    assert_eq!(document["lights"]["area_primitives"], 2);
    assert_eq!(document["materials"]["plastic"], 1);
    assert_eq!(document["film"]["resolution"], serde_json::json!([24, 16]));
    assert_eq!(
        document["camera"]["position"],
        serde_json::json!([0.0, 1.5, -5.0])
    );
    let trees = document["trees"].as_array().expect("trees");
    let widths: Vec<_> = trees.iter().map(|tree| tree["width"].as_u64()).collect();
    assert_eq!(widths, [Some(4), Some(8), Some(16)]);
    assert!(trees.iter().all(|tree| tree["nodes"].as_u64() >= Some(1)));

    let text = place.run(&["info", "room.pbrt"]).expect(0).stdout;
    for word in ["12 triangles", "1 spheres", "24 x 16", "path", "width"] {
        assert!(text.contains(word), "{word}: {text}");
    }
    assert_eq!(place.files(), ["room.pbrt", "thing.ply"]);
}

#[test]
fn instances_are_counted_as_often_as_they_stand() {
    let place = Place::with_room();
    let scene = "WorldBegin ObjectBegin \"a\" Shape \"plymesh\" \"string filename\" \"thing.ply\"\n\
        Shape \"sphere\" ObjectEnd ObjectBegin \"unused\" Shape \"sphere\" ObjectEnd\n\
        ObjectInstance \"a\" Translate 3 0 0 ObjectInstance \"a\" Translate 3 0 0 ObjectInstance \"a\" WorldEnd";
    place.write("three.pbrt", scene);
    let document = place
        .run(&["info", "three.pbrt", "--json", "-"])
        .expect(0)
        .json();
    for (field, expected) in [
        ("shapes", 6),
        ("triangles", 12),
        ("spheres", 3),
        ("primitives", 5),
        ("objects", 2),
        ("instances", 3),
        ("stored_triangles", 4),
    ] {
        assert_eq!(document[field], expected, "{field}");
    }
    let text = place.run(&["info", "three.pbrt"]).expect(0).stdout;
    assert!(
        text.contains("2 with 3 instances; 4 triangles are stored"),
        "{text}"
    );
}
