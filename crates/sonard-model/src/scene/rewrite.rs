//! A scene file with walls and materials as they have become.

use serde_json::{Value, json};

use super::{Scene, Wall};

impl Scene {
    /// The scene's file with the places of its walls and the reflectances of its materials as they are in it now,
    /// and all else as it was written.
    #[must_use]
    pub fn rewritten(&self) -> String {
        let Ok(mut file) = serde_json::from_str::<Value>(&self.text) else {
            // Every scene was read from a text that is one.
            return self.text.to_string();
        };
        let mut walls = self.walls.iter();
        if let Some(entries) = file.get_mut("walls").and_then(Value::as_array_mut) {
            entries.iter_mut().for_each(|entry| write_walls(entry, &mut walls));
        }
        if let Some(materials) = file.get_mut("materials").and_then(Value::as_object_mut) {
            for (name, written) in materials {
                if let Some(material) = self.materials.get(name) {
                    written["reflectance"] = json!(material.reflectance);
                }
            }
        }
        format!("{file:#}\n")
    }
}

fn write_walls<'a>(entry: &mut Value, walls: &mut impl Iterator<Item = &'a Wall>) {
    let is_closed = entry.get("closed").and_then(Value::as_bool).unwrap_or(false);
    let Some(corners) = entry.get_mut("polyline").and_then(Value::as_array_mut) else {
        if let Some(wall) = walls.next() {
            (entry["from"], entry["to"]) = (json!(wall.a.to_array()), json!(wall.b.to_array()));
        }
        return;
    };
    let count = corners.len() - usize::from(!is_closed);
    for at in 0..count {
        let Some(wall) = walls.next() else { return };
        corners[at] = json!(wall.a.to_array());
        if at + 1 < corners.len() {
            corners[at + 1] = json!(wall.b.to_array());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Scene, shipped};
    use crate::geometry::DVec2;

    #[test]
    fn a_scene_that_did_not_change_is_the_same_and_a_moved_one_has_moved() {
        for name in shipped::names() {
            let scene = Scene::from_json(shipped::text(name).expect("shipped")).expect("a scene");
            let again = Scene::from_json(&scene.rewritten()).expect("a scene");
            assert_eq!(again.walls, scene.walls, "{name}");
            assert_eq!(
                (again.poses, again.materials),
                (scene.poses.clone(), scene.materials.clone())
            );
            let mut moved = scene.clone();
            // No farther than that all named poses stay where one can stand.
            let by = DVec2::new(0.02, -0.01);
            moved.walls.iter_mut().for_each(|wall| (wall.a, wall.b) = (wall.a + by, wall.b + by));
            let again = Scene::from_json(&moved.rewritten()).expect("a scene");
            assert_eq!(again.walls, moved.walls, "{name}");
        }
    }
}
