//! Worlds of Gazebo: states, frames, rotations, and what is left out.

use std::fs;

use super::*;

/// A world of these elements.
fn world(content: &str) -> String {
    format!("<?xml version='1.0'?>\n<sdf version='1.9'><world name='w'>{content}</world></sdf>")
}

/// A model with a box of this size; `pose` is an element.
fn block(name: &str, pose: &str, size: &str) -> String {
    format!(
        "<model name='{name}'>{pose}<link name='l'><collision name='c'><geometry><box><size>{size}</size></box></geometry>\
         </collision></link></model>"
    )
}

/// Returns the extents of the walls in a world, rounded to millimetres, and the messages.
fn extents(text: &str) -> (Vec<[f64; 4]>, String) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.sdf");
    fs::write(&path, text).expect("writable");
    let output = run(&["scene", "from-sdf", path.to_str().expect("a plain path")]);
    let printed = stderr(&output);
    assert!(output.status.success(), "{printed}");
    let scene =
        Scene::from_json(&String::from_utf8(output.stdout).expect("text")).expect("a scene");
    let mut found: Vec<(String, [f64; 4])> = Vec::new();
    for wall in &scene.walls {
        let id = wall.id.split('.').next().unwrap_or_default().to_owned();
        if found.last().is_none_or(|(known, _)| *known != id) {
            found.push((id, [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY]));
        }
        let (_, [low_x, low_y, high_x, high_y]) = found.last_mut().expect("one");
        for end in [wall.a, wall.b] {
            (*low_x, *low_y) = (low_x.min(end.x), low_y.min(end.y));
            (*high_x, *high_y) = (high_x.max(end.x), high_y.max(end.y));
        }
    }
    let rounded = |extent: [f64; 4]| extent.map(|m| (1e3 * m).round() / 1e3 + 0.0);
    (found.into_iter().map(|(_, extent)| rounded(extent)).collect(), printed)
}

#[test]
fn saved_state() {
    let a = block("a", "<pose>0 2 0.5 0 0 0</pose>", "4 0.2 1");
    let b = block("b", "<pose>0 -1 0.5 0 0 0</pose>", "1 1 1");
    let c = block("c", "<pose>-3 0 0.5 0 0 0</pose>", "1 0.2 1");
    let state = "<state world_name='w'>\
        <model name='a'><pose>3 1 0.5 0 0 1.570796</pose><scale>1 1 1</scale><link name='l'><pose>3 1 0.5 0 0 1.570796</pose></link></model>\
        <model name='b'><scale>2 1 1</scale></model><deletions><name>c</name></deletions>\
        <insertions><model name='d'><pose>5 5 0.5 0 0 0</pose><link name='l'><collision name='c'><geometry><box><size>1 1 1</size>\
        </box></geometry></collision></link></model></insertions></state>";
    let (found, _) = extents(&world(&format!("{a}{b}{c}{state}")));
    assert_eq!(found, [[2.9, -1.0, 3.1, 3.0], [-1.0, -1.5, 1.0, -0.5], [4.5, 4.5, 5.5, 5.5]]);
    // The pose of a link alone, in a model within a model.
    let nested =
        format!("<model name='o'><pose>1 0 0 0 0 0</pose>{}</model>", block("i", "", "1 1 1"));
    let state = "<state><model name='o'><model name='i'><link name='l'><pose>7 7 0.5 0 0 0</pose></link></model></model></state>";
    let (found, _) = extents(&world(&format!("{nested}{state}")));
    assert_eq!(found, [[6.5, 6.5, 7.5, 7.5]]);
}

#[test]
fn relative_poses() {
    let box_at = |pose: &str| block("a", pose, "1 1 1");
    for (content, expected) in [
        (box_at("<pose relative_to='world'>1 1 0.5 0 0 0</pose>"), [0.5, 0.5, 1.5, 1.5]),
        (
            box_at("<pose>1 1 0.5 0 0 0</pose>").replace("<link name='l'>", "<link name='l'><pose relative_to='__model__'>1 0 0 0 0 0</pose>"),
            [1.5, 0.5, 2.5, 1.5],
        ),
        (
            format!("<frame name='f'><pose>2 0 0.5 0 0 1.570796</pose></frame>{}", box_at("<pose relative_to='f'>1 0 0 0 0 0</pose>")),
            [1.5, 0.5, 2.5, 1.5],
        ),
        (
            format!("<model name='m'><pose>3 0 0.5 0 0 0</pose></model>{}", box_at("<pose relative_to='m'>1 0 0 0 0 0</pose>")),
            [3.5, -0.5, 4.5, 0.5],
        ),
        (
            "<model name='m'><pose>1 0 0.5 0 0 0</pose><link name='j'><pose>1 0 0 0 0 0</pose></link><link name='l'>\
             <pose relative_to='j'>1 0 0 0 0 0</pose><collision name='c'><geometry><box><size>1 1 1</size></box></geometry>\
             </collision></link></model>".to_owned(),
            [2.5, -0.5, 3.5, 0.5],
        ),
        (
            box_at("<pose rotation_format='quat_xyzw'>1 1 0.5  0 0 0.7071068 0.7071068</pose>").replace("1 1 1<", "2 0.2 1<"),
            [0.9, 0.0, 1.1, 2.0],
        ),
    ] {
        let (found, printed) = extents(&world(&content));
        assert_eq!((found, printed.as_str()), (vec![expected], ""), "{content}");
    }
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.sdf");
    // Frames that are relative to each other end.
    let ring = "<frame name='f'><pose relative_to='g'>0 0 0 0 0 0</pose></frame><frame name='g'><pose relative_to='f'>0 0 0 0 0 0</pose></frame>";
    fs::write(
        &path,
        world(&format!("{ring}{}", box_at("<pose relative_to='f'>0 0 0 0 0 0</pose>"))),
    )
    .expect("writable");
    refused(&["scene", "from-sdf", path.to_str().expect("a plain path")], "no wall");
}

#[test]
fn ignored_objects_are_reported() {
    let plain = block("b", "<pose>0 2 0.5 0 0 0</pose>", "1 0.2 1");
    for (content, part) in [
        (
            "<model name='p'><link name='l'><collision name='c'><pose>3 0 0 0 1.570796 0</pose><geometry><plane><normal>0 0 1</normal>\
             </plane></geometry></collision></link></model>",
            "plane of `p`",
        ),
        ("<population name='crowd'><model name='x'/></population>", "population `crowd`"),
        (
            "<model name='ball'><link name='l'><collision name='c'><geometry><sphere><radius>1</radius></sphere></geometry></collision></link></model>",
            "sphere of `ball`",
        ),
        ("<include><uri>model://chair</uri></include>", "model://chair"),
    ] {
        let (found, printed) = extents(&world(&format!("{plain}{content}")));
        assert!(found.len() == 1 && printed.contains(part), "{part}: {printed}");
    }
}

#[test]
fn included_models() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::create_dir(folder.path().join("shelf")).expect("writable");
    let model = format!(
        "<sdf version='1.6'>{}</sdf>",
        block("shelf", "<pose>9 9 0.5 0 0 0</pose>", "1 1 1")
    );
    fs::write(folder.path().join("shelf/model.sdf"), model).expect("writable");
    let path = folder.path().join("a.world");
    let include =
        "<include><uri>model://shelf</uri><name>s</name><pose>2 3 0.5 0 0 0</pose></include>";
    fs::write(&path, world(include)).expect("writable");
    let scene = made(&["scene", "from-sdf", path.to_str().expect("a plain path")]);
    assert!(
        scene.walls.iter().all(|wall| wall.id.starts_with("s-1") && (wall.a.x - 2.0).abs() < 0.6),
        "{:?}",
        scene.walls
    );
    // An unreadable model is reported with its path and the reason, a world is rejected with it.
    let large = "x".repeat((16 << 20) + 1);
    for (content, why) in [
        (large.as_bytes(), "model.sdf: the file is larger than 16 MB"),
        (b"<sdf><model></sdf>", "model.sdf: invalid XML"),
        (b"<sdf version='1.6'/>", "model.sdf: no model"),
    ] {
        fs::write(folder.path().join("shelf/model.sdf"), content).expect("writable");
        refused(&["scene", "from-sdf", path.to_str().expect("a plain path")], why);
    }
    fs::write(&path, &large).expect("writable");
    refused(&["scene", "from-sdf", path.to_str().expect("a plain path")], "larger than 16 MB");
    // Not what is outside its folder.
    let outside = include.replace("model://shelf", "../shelf");
    fs::create_dir(folder.path().join("worlds")).expect("writable");
    let path = folder.path().join("worlds/a.world");
    fs::write(&path, world(&outside)).expect("writable");
    refused(&["scene", "from-sdf", path.to_str().expect("a plain path")], "no wall");
}
