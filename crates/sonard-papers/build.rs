//! Commit of the program, for `sonard-papers --version`.

fn main() {
    sonard_build::emit(sonard_build::Package { folder: "crates/sonard-papers/", features: &[] });
}
