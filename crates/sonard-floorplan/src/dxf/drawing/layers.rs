//! Selection of a drawing's layers. Layer names are case-insensitive.

use std::collections::BTreeSet;

use dxf::Drawing;

use super::reduce::Reduced;

/// Selected and hidden layers.
pub(super) struct Layers {
    shown: BTreeSet<String>,
    hidden: BTreeSet<String>,
}

impl Layers {
    /// Selects the named layers of a drawing, or else all that are on and not frozen.
    ///
    /// # Errors
    ///
    /// A named layer is empty.
    pub(super) fn select(
        drawing: &Drawing,
        reduced: &Reduced,
        requested: &[String],
    ) -> Result<Self, (String, String)> {
        let in_blocks = drawing.blocks().flat_map(|block| &block.entities);
        let converted = drawing.entities().chain(in_blocks).map(|entity| &entity.common.layer);
        let ignored = reduced.ignored.values().flatten().map(|ignored| &ignored.layer);
        let used: BTreeSet<String> = converted.chain(ignored).cloned().collect();
        let has =
            |requested: &str| used.iter().any(|name| normalized(name) == normalized(requested));
        if let Some(requested) = requested.iter().find(|requested| !has(requested)) {
            let names: Vec<&str> = used.iter().map(String::as_str).collect();
            let help = format!("layers with entities: {}", names.join(", "));
            return Err((format!("layer `{requested}` is empty"), help));
        }
        let off = drawing
            .layers()
            .filter(|layer| !layer.is_layer_on)
            .map(|layer| normalized(&layer.name));
        let hidden: BTreeSet<String> =
            off.chain(reduced.frozen.iter().map(|name| normalized(name))).collect();
        let all = used.iter().map(|name| normalized(name));
        let shown = match requested.is_empty() {
            true => all.filter(|name| !hidden.contains(name)).collect(),
            false => requested.iter().map(|name| normalized(name)).collect(),
        };
        Ok(Self { shown, hidden })
    }

    pub(super) fn has(&self, layer: &str) -> bool {
        self.shown.contains(&normalized(layer))
    }

    /// Returns notes on ignored layers.
    pub(super) fn notes(&self, requested: &[String]) -> Vec<String> {
        let mut notes = Vec::new();
        if requested.is_empty() && !self.hidden.is_empty() {
            let hidden: Vec<&str> = self.hidden.iter().map(String::as_str).collect();
            notes.push(format!("layers ignored, off or frozen: {}", hidden.join(", ")));
        }
        notes
    }
}

/// Normalizes a name for case-insensitive comparison.
fn normalized(name: &str) -> String {
    name.to_uppercase()
}
