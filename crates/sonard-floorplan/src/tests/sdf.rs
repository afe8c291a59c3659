//! Worlds as SDF.

use std::path::{Path, PathBuf};

use super::walls;
use crate::{
    FloorPlan,
    sdf::{self, Library, SdfOptions},
};

/// Library with one model, a box on the ground.
struct Table;

impl Library for Table {
    fn model(
        &self,
        uri: &str,
        _: Option<&std::path::Path>,
    ) -> Option<(std::path::PathBuf, Vec<u8>)> {
        let model = format!("<sdf version='1.9'>{}</sdf>", model("table", "0 0 0.5 0 0 0"));
        (uri == "model://table").then(|| (uri.into(), model.into_bytes()))
    }
}

fn model(name: &str, pose: &str) -> String {
    format!(
        "<model name='{name}'><pose>{pose}</pose><link name='l'><collision name='c'><geometry><box><size>2 1 1</size></box>\
         </geometry></collision></link></model>"
    )
}

fn world(content: &str) -> FloorPlan {
    let text = format!("<sdf version='1.9'><world name='w'>{content}</world></sdf>");
    sdf::read(text.as_bytes(), &SdfOptions { cut_z_m: 0.2 }, &Table).expect("a world")
}

#[test]
fn state_of_included_models() {
    let state = "<state world_name='w'><model name='t'><pose>3 0 0.5 0 0 0</pose><link name='l'><pose>3 5 0.5 0 0 0</pose></link>\
                 </model></state>";
    let plan = world(&format!("<include><uri>model://table</uri><name>t</name></include>{state}"));
    assert_eq!(walls(&plan)[0], [2.0, 4.5, 4.0, 4.5]);
}

#[test]
fn omissions_are_named() {
    let content = format!(
        "{}{}<actor name='walker'/><include><uri>model://lamp</uri></include>",
        model("a", "0 0 0.5 0 0 0"),
        model("high", "0 0 5 0 0 0")
    );
    let text = format!(
        "<sdf version='1.9'><world name='w'>{content}</world><world name='v'>{}</world></sdf>",
        model("b", "0 9 0.5 0 0 0")
    );
    let plan = sdf::read(text.as_bytes(), &SdfOptions { cut_z_m: 0.2 }, &Table).expect("a world");
    assert_eq!(walls(&plan).len(), 4);
    let notes = plan.notes.join("\n");
    for part in ["actor `walker`", "model://lamp", "world `v`", "1 shapes are above or below"] {
        assert!(notes.contains(part), "{part}: {notes}");
    }
}

#[test]
fn nesting_is_limited() {
    let deep = "<model name='m'>".repeat(300) + &"</model>".repeat(300);
    assert!(world(&deep).notes.iter().any(|note| note.contains("nested too deeply")));
    let joint = "<model name='m'><link name='base'><pose>1 0 0 0 0 0</pose></link><joint name='j'><child>base</child></joint>\
                 <link name='l'><pose relative_to='j'>2 0 0.5 0 0 0</pose><collision name='c'><geometry><box><size>2 1 1</size></box>\
                 </geometry></collision></link></model>";
    assert_eq!(walls(&world(joint))[0], [2.0, -0.5, 4.0, -0.5]);
}

/// Library in which every model includes itself repeatedly.
struct Recursive {
    padding: usize,
}

impl Library for Recursive {
    fn model(&self, uri: &str, _: Option<&Path>) -> Option<(PathBuf, Vec<u8>)> {
        let include = "<include><uri>model://again</uri></include>".repeat(4);
        let padding = " ".repeat(self.padding);
        let model = format!("<sdf version='1.6'><model name='m'>{include}{padding}</model></sdf>");
        Some((PathBuf::from(uri), model.into_bytes()))
    }
}

#[test]
fn recursive_models_are_bounded() {
    let world = "<sdf version='1.6'><world name='w'><include><uri>model://again</uri></include></world></sdf>";
    for (padding, limit) in [(0, "8 nested files"), (1 << 20, "64 MB of included files")] {
        let plan =
            sdf::read(world.as_bytes(), &SdfOptions { cut_z_m: 0.2 }, &Recursive { padding });
        let notes = plan.expect("a world").notes;
        let expected = format!("ignored: the model `model://again`: more than {limit}");
        assert!(notes.contains(&expected), "{padding}: {notes:?}");
    }
}

#[test]
fn notes_are_distinct_and_bounded() {
    let include = |name: usize| format!("<include><uri>model://m{name}</uri></include>");
    let includes: String = (0..500).chain(0..500).map(include).collect();
    let world = format!("<sdf version='1.6'><world name='w'>{includes}</world></sdf>");
    let plan = sdf::read(world.as_bytes(), &SdfOptions { cut_z_m: 0.2 }, &sdf::NoLibrary);
    let notes = plan.expect("a world").notes;
    assert_eq!((notes.len(), notes.last().map(String::as_str)), (101, Some("900 further notes")));
}
