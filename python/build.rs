//! Commit of the package, for `sonard.__commit__`.

fn main() {
    sonard_build::emit(sonard_build::Package { folder: "python/", features: &[] });
}
