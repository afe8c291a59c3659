//! Output of a scene file with modified walls and materials.

use serde_json::{Value, json};

use super::{Scene, Wall};

impl Scene {
    /// Text of the scene file with the current positions of its walls and reflectances of its
    /// materials. Everything else is unchanged.
    #[must_use]
    pub fn updated_text(&self) -> String {
        let Ok(mut file) = serde_json::from_str::<Value>(&self.text) else {
            // The text of a parsed scene is valid JSON.
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
    fn updates_only_moved_walls() {
        for name in shipped::names() {
            let scene = Scene::from_json(shipped::text(name).expect("shipped")).expect("a scene");
            let again = Scene::from_json(&scene.updated_text()).expect("a scene");
            assert_eq!(again.walls, scene.walls, "{name}");
            assert_eq!(
                (again.poses, again.materials),
                (scene.poses.clone(), scene.materials.clone())
            );
            let mut moved = scene.clone();
            // Small enough that all named poses stay accessible.
            let by = DVec2::new(0.02, -0.01);
            moved.walls.iter_mut().for_each(|wall| (wall.a, wall.b) = (wall.a + by, wall.b + by));
            let again = Scene::from_json(&moved.updated_text()).expect("a scene");
            assert_eq!(again.walls, moved.walls, "{name}");
        }
    }
}
