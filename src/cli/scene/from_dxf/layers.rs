//! Layers of a drawing that count. Their names are the same in capitals and not.

use std::collections::BTreeSet;

use dxf::Drawing;

/// The layers that count, and those that are not seen.
pub(super) struct Layers {
    shown: BTreeSet<String>,
    hidden: BTreeSet<String>,
    /// Frozen layers can't be told in binary files by the crate that reads them.
    is_binary: bool,
}

impl Layers {
    /// The layers of a drawing and its file: those that are wanted, else all that are neither switched off nor frozen.
    ///
    /// # Errors
    /// A wanted layer has nothing on it.
    pub(super) fn of(
        drawing: &Drawing,
        bytes: &[u8],
        wanted: &[String],
    ) -> Result<Self, (String, String)> {
        let in_blocks = drawing.blocks().flat_map(|block| &block.entities);
        let used: BTreeSet<String> =
            drawing.entities().chain(in_blocks).map(|entity| entity.common.layer.clone()).collect();
        let has = |wanted: &str| used.iter().any(|name| same(name) == same(wanted));
        if let Some(wanted) = wanted.iter().find(|wanted| !has(wanted)) {
            let names: Vec<&str> = used.iter().map(String::as_str).collect();
            let help = format!("these have something: {}", names.join(", "));
            return Err((format!("nothing is on layer `{wanted}`"), help));
        }
        let off =
            drawing.layers().filter(|layer| !layer.is_layer_on).map(|layer| same(&layer.name));
        let hidden: BTreeSet<String> = off.chain(frozen(bytes)).collect();
        let all = used.iter().map(|name| same(name));
        let shown = match wanted.is_empty() {
            true => all.filter(|name| !hidden.contains(name)).collect(),
            false => wanted.iter().map(|name| same(name)).collect(),
        };
        let is_binary = bytes.starts_with(b"AutoCAD Binary DXF");
        Ok(Self { shown, hidden, is_binary })
    }

    pub(super) fn has(&self, layer: &str) -> bool {
        self.shown.contains(&same(layer))
    }

    /// Notes on the layers left out.
    pub(super) fn notes(&self, wanted: &[String]) -> Vec<String> {
        let mut notes = Vec::new();
        if wanted.is_empty() && !self.hidden.is_empty() {
            let hidden: Vec<&str> = self.hidden.iter().map(String::as_str).collect();
            notes.push(format!("layers left out, switched off or frozen: {}", hidden.join(", ")));
        }
        if wanted.is_empty() && self.is_binary {
            notes.push(
                "frozen layers can't be told from others in a binary DXF; --layer chooses"
                    .to_owned(),
            );
        }
        notes
    }
}

/// A name as all of its spellings share it.
fn same(name: &str) -> String {
    name.to_uppercase()
}

/// The layers that are frozen: flag 1 of code 70 in the table LAYER of an ASCII file.
fn frozen(bytes: &[u8]) -> BTreeSet<String> {
    let text = String::from_utf8_lossy(bytes);
    let mut lines = text.lines().map(str::trim);
    let (mut frozen, mut name, mut is_layer) = (BTreeSet::new(), None, false);
    while let (Some(code), Some(value)) = (lines.next(), lines.next()) {
        match code {
            "0" => (is_layer, name) = (value == "LAYER", None),
            "2" if is_layer => name = Some(same(value)),
            "70" if is_layer && value.parse().is_ok_and(|flags: i32| flags & 1 == 1) => {
                frozen.extend(name.clone());
            }
            _ => {}
        }
    }
    frozen
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frozen_layers_are_found_whatever_other_flags_they_have() {
        let layer =
            |name: &str, flags: i32| format!("  0\nLAYER\n  2\n{name}\n 70\n{flags}\n 62\n7\n");
        let text = [("walls", 0), ("Furn", 1), ("locked", 4), ("both", 5), ("in new viewports", 2)];
        let text: String = text.iter().map(|(name, flags)| layer(name, *flags)).collect();
        let text = format!("  0\nTABLE\n  2\nLAYER\n 70\n5\n{text}  0\nENDTAB\n");
        let expected: BTreeSet<String> = ["FURN", "BOTH"].map(str::to_owned).into();
        assert_eq!(frozen(text.as_bytes()), expected);
    }
}
