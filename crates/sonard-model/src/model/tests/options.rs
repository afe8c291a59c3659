//! Model options outside their ranges.

use super::*;

#[test]
fn values_out_of_range_are_named() {
    let fan = |ray_spacing_deg| Options::from(FanOptions { ray_spacing_deg, ..BARE });
    let cone = |aperture_deg| Options::from(ConeOptions { aperture_deg: Some(aperture_deg) });
    let usual = Options::default;
    for (options, wrong) in [
        (Options { max_range_m: Some(0.0), ..usual() }, Some("max_range_m")),
        (Options { max_range_m: Some(f64::NAN), ..usual() }, Some("max_range_m")),
        (Options { max_range_m: Some(0.01), ..usual() }, None),
        (Options { threshold: Some(1.5), ..usual() }, Some("threshold")),
        (Options { threshold: Some(1.0), ..usual() }, None),
        (fan(0.0), Some("ray_spacing_deg")),
        (fan(5.5), Some("ray_spacing_deg")),
        (fan(5.0), None),
        (cone(-1.0), Some("aperture_deg")),
        (cone(181.0), Some("aperture_deg")),
        (cone(180.0), None),
        (ConeOptions { aperture_deg: None }.into(), None),
    ] {
        let scene = Arc::new(shipped_scene("simple-room"));
        let sensor = Sensor::preset("senscomp-6500").expect("a preset");
        let made = Simulator::new(scene, sensor, Air::default(), options);
        let message = made.err().map(|error| error.to_string());
        match wrong {
            Some(name) => {
                assert!(
                    message.as_ref().is_some_and(|message| message.contains(name)),
                    "{options:?}: {message:?}"
                );
            }
            None => assert_eq!(message, None, "{options:?}"),
        }
    }
}
