//! Bodies of the fuzz targets on random bytes, on the kept seeds, and on damaged seeds.

#[path = "../fuzz/bodies.rs"]
mod bodies;

use std::{fs, path::Path};

use bodies::{BODIES, run};
use proptest::prelude::*;

/// Seeds of a target; each target has some.
fn seeds(target: &str) -> Vec<Vec<u8>> {
    let folder = Path::new("fuzz/seeds").join(target);
    let entries =
        fs::read_dir(&folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let mut paths: Vec<_> = entries.map(|entry| entry.expect("an entry").path()).collect();
    paths.sort();
    paths.iter().map(|path| fs::read(path).expect("a seed")).collect()
}

#[test]
fn seeds_are_decoded() {
    for (target, _) in BODIES {
        let seeds = seeds(target);
        assert!(!seeds.is_empty(), "{target} has no seeds");
        for seed in seeds {
            run(target, &seed);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn random_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
        for (_, body) in BODIES {
            body(&bytes);
        }
    }

    #[test]
    fn damaged_seeds_never_panic(
        pick in any::<prop::sample::Index>(),
        at in any::<prop::sample::Index>(),
        replaced in proptest::collection::vec(any::<u8>(), 0..6),
        cut in any::<bool>(),
    ) {
        for (target, body) in BODIES {
            let seeds = seeds(target);
            let mut bytes = seeds[pick.index(seeds.len())].clone();
            let at = at.index(bytes.len().max(1)).min(bytes.len());
            let end = (at + replaced.len()).min(bytes.len());
            bytes.splice(at..end, replaced.iter().copied());
            if cut {
                bytes.truncate(at);
            }
            body(&bytes);
        }
    }
}
