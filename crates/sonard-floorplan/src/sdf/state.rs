//! Saved state of a world: poses in the world, scales and deletions that override those of the
//! models (SDFormat, state.sdf).

use glam::{DAffine3, DVec3};
use roxmltree::Node;

use super::{World, child};
use crate::PlanError;

/// State elements of a world or model; the last one takes precedence.
#[derive(Debug, Clone, Default)]
pub(super) struct State<'s, 'n> {
    elements: Vec<Node<'s, 'n>>,
}

impl<'s, 'n> State<'s, 'n> {
    pub(super) const fn new(elements: Vec<Node<'s, 'n>>) -> Self {
        Self { elements }
    }

    /// Returns the state of a member model.
    pub(super) fn of_model(&self, name: &str) -> Self {
        let models = self.elements.iter().flat_map(|element| element.children());
        let is_of =
            |node: &Node| node.has_tag_name("model") && node.attribute("name") == Some(name);
        Self { elements: models.filter(is_of).collect() }
    }

    pub(super) fn is_deleted(&self, name: &str) -> bool {
        let deletions = self.elements.iter().filter_map(|element| child(*element, "deletions"));
        let mut names = deletions.flat_map(|deletions| deletions.children());
        names.any(|node| node.has_tag_name("name") && node.text().map(str::trim) == Some(name))
    }

    /// Returns the models that the state adds to the world.
    pub(super) fn insertions(&self) -> Vec<Node<'s, 'n>> {
        let insertions = self.elements.iter().filter_map(|element| child(*element, "insertions"));
        let models = insertions.flat_map(|insertions| insertions.children());
        models.filter(|node| node.has_tag_name("model")).collect()
    }

    /// Returns the pose of the model in the world, if the state has one.
    pub(super) fn pose(&self, world: &World) -> Result<Option<DAffine3>, PlanError> {
        let pose = self.elements.iter().rev().find_map(|element| child(*element, "pose"));
        pose.map(|pose| world.pose(pose)).transpose()
    }

    pub(super) fn scale(&self, world: &World) -> Result<DVec3, PlanError> {
        let scale = self.elements.iter().rev().find_map(|element| child(*element, "scale"));
        Ok(match scale {
            Some(scale) => DVec3::from(world.numbers(scale)?),
            None => DVec3::ONE,
        })
    }

    /// Returns the pose in the world of a link of the model, if the state has one.
    pub(super) fn of_link(&self, name: &str, world: &World) -> Result<Option<DAffine3>, PlanError> {
        let links = self.elements.iter().rev().flat_map(|element| element.children());
        let mut links =
            links.filter(|node| node.has_tag_name("link") && node.attribute("name") == Some(name));
        let pose = links.find_map(|link| child(link, "pose"));
        pose.map(|pose| world.pose(pose)).transpose()
    }
}
