//! Selection of a drawing's layers. Layer names are case-insensitive.

use std::collections::BTreeSet;

use dxf::Drawing;

/// Selected and hidden layers.
pub(super) struct Layers {
    shown: BTreeSet<String>,
    hidden: BTreeSet<String>,
    /// The parser does not report frozen layers of binary files.
    is_binary: bool,
}

impl Layers {
    /// Selects the named layers of a drawing, or else all that are on and not frozen.
    ///
    /// # Errors
    ///
    /// A named layer is empty.
    pub(super) fn select(
        drawing: &Drawing,
        bytes: &[u8],
        requested: &[String],
    ) -> Result<Self, (String, String)> {
        let in_blocks = drawing.blocks().flat_map(|block| &block.entities);
        let used: BTreeSet<String> =
            drawing.entities().chain(in_blocks).map(|entity| entity.common.layer.clone()).collect();
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
        let hidden: BTreeSet<String> = off.chain(frozen_layers(bytes)).collect();
        let all = used.iter().map(|name| normalized(name));
        let shown = match requested.is_empty() {
            true => all.filter(|name| !hidden.contains(name)).collect(),
            false => requested.iter().map(|name| normalized(name)).collect(),
        };
        let is_binary = bytes.starts_with(b"AutoCAD Binary DXF");
        Ok(Self { shown, hidden, is_binary })
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
        if requested.is_empty() && self.is_binary {
            notes.push(
                "frozen layers can't be detected in a binary DXF; select layers with --layer"
                    .to_owned(),
            );
        }
        notes
    }
}

/// Normalizes a name for case-insensitive comparison.
fn normalized(name: &str) -> String {
    name.to_uppercase()
}

/// Returns the frozen layers: flag 1 of code 70 in the table LAYER of an ASCII file.
fn frozen_layers(bytes: &[u8]) -> BTreeSet<String> {
    let text = String::from_utf8_lossy(bytes);
    let mut lines = text.lines().map(str::trim);
    let (mut frozen_layers, mut name, mut is_layer) = (BTreeSet::new(), None, false);
    while let (Some(code), Some(value)) = (lines.next(), lines.next()) {
        match code {
            "0" => (is_layer, name) = (value == "LAYER", None),
            "2" if is_layer => name = Some(normalized(value)),
            "70" if is_layer && value.parse().is_ok_and(|flags: i32| flags & 1 == 1) => {
                frozen_layers.extend(name.clone());
            }
            _ => {}
        }
    }
    frozen_layers
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frozen_layers_with_other_flags() {
        let layer =
            |name: &str, flags: i32| format!("  0\nLAYER\n  2\n{name}\n 70\n{flags}\n 62\n7\n");
        let text = [("walls", 0), ("Furn", 1), ("locked", 4), ("both", 5), ("in new viewports", 2)];
        let text: String = text.iter().map(|(name, flags)| layer(name, *flags)).collect();
        let text = format!("  0\nTABLE\n  2\nLAYER\n 70\n5\n{text}  0\nENDTAB\n");
        let expected: BTreeSet<String> = ["FURN", "BOTH"].map(str::to_owned).into();
        assert_eq!(frozen_layers(text.as_bytes()), expected);
    }
}
