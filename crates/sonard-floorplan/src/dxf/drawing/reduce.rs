//! Reduction of a DXF file to the entities that are converted.

use std::collections::{BTreeMap, BTreeSet};

use super::pairs::{BINARY, records};

/// Entities that are converted, and their parts.
const KEPT: [&str; 14] = [
    "LINE",
    "LWPOLYLINE",
    "POLYLINE",
    "VERTEX",
    "SEQEND",
    "CIRCLE",
    "ARC",
    "INSERT",
    "ATTRIB",
    "SOLID",
    "TRACE",
    "BLOCK",
    "ENDBLK",
    "ENDSEC",
];
/// Sections that describe the drawing.
const SECTIONS: [&str; 4] = ["HEADER", "TABLES", "BLOCKS", "ENTITIES"];

/// Entity that is not converted.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct IgnoredEntity {
    pub(super) kind: String,
    pub(super) layer: String,
}

/// Reduced drawing.
#[derive(Debug, Default)]
pub(super) struct Reduced {
    /// The file without other sections and entities.
    pub(super) bytes: Vec<u8>,
    /// Names of the layers that are frozen.
    pub(super) frozen: BTreeSet<String>,
    /// Visible entities that were removed, by the upper-case name of their block; of the drawing
    /// itself by an empty name.
    pub(super) ignored: BTreeMap<String, Vec<IgnoredEntity>>,
}

/// Reduces a file. A malformed rest is kept, so that the parser reports it.
pub(super) fn reduce(bytes: &[u8]) -> Reduced {
    let mut reduced = Reduced::default();
    if bytes.starts_with(BINARY) {
        reduced.bytes.extend(BINARY);
    }
    let (mut section, mut block) = (String::new(), String::new());
    let mut end = 0;
    for record in records(bytes) {
        end = record.bytes.end;
        if record.kind == "SECTION" {
            section = record.name.clone().unwrap_or_default();
            block.clear();
        }
        let is_kept = match section.as_str() {
            "BLOCKS" | "ENTITIES" if record.kind != "SECTION" => {
                if record.kind == "BLOCK" {
                    block = record.name.clone().unwrap_or_default().to_uppercase();
                } else if record.kind == "ENDBLK" {
                    block.clear();
                }
                KEPT.contains(&record.kind.as_str())
            }
            "TABLES" => {
                if record.kind == "LAYER" && record.flags & FROZEN != 0 {
                    reduced.frozen.extend(record.name.clone());
                }
                true
            }
            known => SECTIONS.contains(&known) || record.kind == "EOF" || known.is_empty(),
        };
        let is_end = record.kind == "ENDSEC" || record.kind == "EOF";
        if is_kept {
            reduced.bytes.extend(&bytes[record.bytes.clone()]);
        } else if SECTIONS.contains(&section.as_str()) && !record.is_hidden && !is_end {
            let ignored = reduced.ignored.entry(block.clone()).or_default();
            if ignored.len() < MAX_IGNORED {
                let layer = record.layer.unwrap_or_else(|| "0".to_owned());
                ignored.push(IgnoredEntity { kind: record.kind, layer });
            }
        }
        if is_end {
            section.clear();
        }
    }
    // A group that cannot be read ends the records.
    if bytes[end..].iter().any(|byte| !byte.is_ascii_whitespace() && *byte != 0x1a && *byte != 0) {
        reduced.bytes.extend(&bytes[end..]);
    }
    reduced
}

/// Flag of a frozen layer, in group 70.
const FROZEN: i64 = 1;
/// Maximum number of removed entities that are counted, of each block.
const MAX_IGNORED: usize = 100_000;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_entities_are_removed() {
        let text = "  0\nSECTION\n  2\nTABLES\n  0\nTABLE\n  2\nLAYER\n 70\n3\n  0\nLAYER\n  2\nFurn\n 70\n5\n  0\nLAYER\n  2\n\
            locked\n 70\n4\n  0\nENDTAB\n  0\nENDSEC\n  0\nSECTION\n  2\nBLOCKS\n  0\nBLOCK\n  2\nDoor\n  0\nHATCH\n  8\nA\n\
            0\nENDBLK\n  0\nENDSEC\n  0\nSECTION\n  2\nENTITIES\n  0\nLINE\n  8\nA\n  0\nMULTILEADER\n  8\nB\n170\n1\n\
            0\nTEXT\n 67\n1\n  0\nENDSEC\n  0\nSECTION\n  2\nOBJECTS\n  0\nDICTIONARY\n  0\nENDSEC\n  0\nEOF\n";
        let reduced = reduce(text.as_bytes());
        assert_eq!(reduced.frozen, BTreeSet::from(["Furn".to_owned()]));
        let ignored = |block: &str, kind: &str| {
            let found = reduced.ignored.get(block).into_iter().flatten();
            found.filter(|ignored| ignored.kind == kind).count()
        };
        assert_eq!(
            (ignored("DOOR", "HATCH"), ignored("", "MULTILEADER"), ignored("", "TEXT")),
            (1, 1, 0)
        );
        let kept = String::from_utf8(reduced.bytes).expect("text");
        assert!(kept.contains("LINE") && kept.ends_with("EOF\n"), "{kept}");
        for removed in ["HATCH", "MULTILEADER", "OBJECTS", "DICTIONARY", "TEXT"] {
            assert!(!kept.contains(removed), "{removed}: {kept}");
        }
        assert_eq!(kept.matches("ENDSEC").count(), kept.matches("SECTION").count());
    }
}
