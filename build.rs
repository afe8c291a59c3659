//! Commit and features of the program, for `sonard --version` and for the sessions of logs.

fn main() {
    sonard_build::emit(sonard_build::Package {
        folder: "",
        features: &["daemon", "pi", "dxf", "lz4", "manual", "mqtt", "ros", "sqlite"],
    });
}
