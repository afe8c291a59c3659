use super::*;
use sonard_records::{Record, decode_line};

const LOG: &str = include_str!("../../../../tests/fixtures/small.jsonl");

fn scans() -> Vec<ScanView> {
    ScanView::from_records(LOG.lines().map(|line| decode_line(line.as_bytes()).expect("clean")))
}

/// Reading of the fixture with measured and simulated status and range replaced.
fn ping(
    measured: (PingStatus, Option<f64>),
    simulated: Option<(PingStatus, Option<f64>)>,
    kind: PathKind,
    order: u32,
) -> Ping {
    let mut ping = scans()[0].pings[0].clone();
    (ping.status, ping.range_m) = measured;
    let mut sim = ping.sim.take();
    if let (Some(sim), Some((status, range_m))) = (&mut sim, simulated) {
        (sim.status, sim.range_m) = (status, range_m);
        if let Some(path) = &mut sim.path {
            (path.kind, path.order) = (kind, order);
        }
    }
    ping.sim = sim.filter(|_| simulated.is_some());
    ping
}

#[test]
fn each_pair_of_outcomes_is_classified() {
    use PathKind::{Diffracted, Specular};
    use PingStatus::{Echo, LinkLost, MinRange, ModuleFault, NoEcho, StepUncertain};
    use Verdict::{Direct, Edge, MinRange as Near, Multiple, NoEcho as BothNoEcho, Unexplained};
    let (echo, no_echo) = ((Echo, Some(1.0)), (NoEcho, None));
    let near = (MinRange, Some(0.41));
    for (measured, simulated, kind, order, expected) in [
        (echo, Some(echo), Specular, 1, Ok(Direct)),
        (echo, Some(echo), Specular, 2, Ok(Multiple)),
        (echo, Some(echo), Diffracted, 0, Ok(Edge)),
        (echo, Some(echo), Diffracted, 3, Ok(Edge)),
        (echo, Some((Echo, Some(1.010))), Specular, 1, Ok(Direct)),
        (echo, Some((Echo, Some(1.0101))), Specular, 1, Ok(Unexplained)),
        ((Echo, Some(5.0)), Some((Echo, Some(5.05))), Specular, 1, Ok(Direct)),
        ((Echo, Some(0.1)), Some((Echo, Some(0.11))), Specular, 1, Ok(Direct)),
        (near, Some(near), Specular, 1, Ok(Near)),
        (near, Some((MinRange, None)), Specular, 1, Ok(Near)),
        (near, Some((Echo, Some(0.415))), Specular, 1, Ok(Near)),
        ((Echo, Some(0.415)), Some(near), Specular, 1, Ok(Near)),
        (near, Some(echo), Specular, 1, Ok(Unexplained)),
        (near, Some(no_echo), Specular, 1, Ok(Unexplained)),
        (no_echo, Some(no_echo), Specular, 1, Ok(BothNoEcho)),
        (no_echo, Some(echo), Specular, 1, Ok(Unexplained)),
        (echo, Some(no_echo), Specular, 1, Ok(Unexplained)),
        (echo, None, Specular, 1, Err(NotCompared::NoPrediction)),
        ((Echo, None), Some(echo), Specular, 1, Err(NotCompared::NoRange)),
        ((Echo, Some(f64::NAN)), Some(echo), Specular, 1, Err(NotCompared::NoRange)),
        (echo, Some((Echo, None)), Specular, 1, Err(NotCompared::NoRange)),
        ((LinkLost, None), Some(echo), Specular, 1, Err(NotCompared::LinkLost)),
        ((ModuleFault, None), Some(echo), Specular, 1, Err(NotCompared::ModuleFault)),
        ((StepUncertain, None), Some(echo), Specular, 1, Err(NotCompared::StepUncertain)),
    ] {
        let ping = ping(measured, simulated, kind, order);
        assert_eq!(
            classify(&ping).verdict,
            expected,
            "{measured:?} {simulated:?} {kind:?} {order}"
        );
    }
}

#[test]
fn fixture_is_counted() {
    let scans = scans();
    let (comparison, classified) = compare(&scans);
    assert_eq!(classified.len(), 7);
    let each_once =
        VerdictCounts { direct: 1, multiple: 1, edge: 1, min_range: 1, silent: 1, unexplained: 1 };
    assert_eq!(comparison.verdicts, each_once);
    let Comparison { beams, both_echo, agree, min_range: near, both_no_echo: both_silent, .. } =
        comparison;
    assert_eq!((beams, both_echo, agree, near, both_silent), (6, 4, 3, 1, 1));
    assert_eq!(comparison.not_compared, NotComparedCounts { link_lost: 1, ..Default::default() });
    // |r| is 1.0, 3.2, 4.8 and 300 mm.
    let close = |value: Option<f64>, expected: f64| {
        assert!(value.is_some_and(|v| (v - expected).abs() < 1e-12), "{value:?} {expected}");
    };
    close(comparison.agree_fraction, 0.75);
    close(comparison.median_abs_residual_m, 0.004);
    close(comparison.p90_abs_residual_m, 0.0048 + 0.7 * (0.3 - 0.0048));
}

#[test]
fn no_pairs_yield_nulls() {
    let mut scans = scans();
    for ping in &mut scans[0].pings {
        ping.sim = None;
    }
    let (comparison, _) = compare(&scans);
    assert_eq!((comparison.beams, comparison.agree_fraction), (0, None));
    // A lost reading counts as lost even without a prediction.
    let skipped = NotComparedCounts { link_lost: 1, no_prediction: 6, ..Default::default() };
    assert_eq!(comparison.not_compared, skipped);
    let json = serde_json::to_value(&comparison).expect("numbers");
    for field in ["agree_fraction", "median_abs_residual_m", "p90_abs_residual_m"] {
        assert!(json[field].is_null(), "{field}");
    }
    assert_eq!(compare(&[]), (Comparison::default(), Vec::new()));
}

#[test]
fn last_received_reading_counts() {
    let mut scans = scans();
    let lost = scans[0].pings[6].clone();
    let mut fetched = scans[0].pings[0].clone();
    fetched.index = 6;
    // Lost, then fetched; and once more lost.
    scans[0].pings = vec![lost.clone(), fetched, lost];
    let (comparison, classified) = compare(&scans);
    assert_eq!((comparison.beams, comparison.duplicates), (1, 2));
    assert_eq!(classified[0].verdict, Ok(Verdict::Direct));
}

#[test]
fn sessions_are_pooled() {
    let twice = LOG.replace("5a0e7f5e", "6b1f8a6f");
    let records = LOG.lines().chain(twice.lines());
    let records: Vec<Record> =
        records.map(|line| decode_line(line.as_bytes()).expect("clean")).collect();
    let scans = ScanView::from_records(records);
    let (comparison, _) = compare(&scans);
    assert_eq!((comparison.scans, comparison.beams, comparison.both_echo), (2, 12, 8));
}

proptest::proptest! {
    /// For any statuses and ranges, every beam is counted exactly once in each partition.
    #[test]
    fn counts_add_up(
        sides in proptest::collection::vec((0..5_usize, 0..6_usize, 0.3..2.0_f64, 0.3..2.0_f64), 0..60)
    ) {
        use PingStatus::{Echo, LinkLost, MinRange, NoEcho, StepUncertain};
        let statuses = [Echo, NoEcho, MinRange, LinkLost, StepUncertain];
        let outcome = |status: PingStatus, m: f64| (status, status.has_range().then_some(m));
        let pings = sides.iter().enumerate().map(|(index, &(m, s, a, b))| {
            let simulated = statuses.get(s).map(|&status| outcome(status, b));
            let mut ping = ping(outcome(statuses[m], a), simulated, PathKind::Specular, 1);
            ping.index = index as u32;
            ping
        });
        let mut view = scans().remove(0);
        view.pings = pings.collect();
        let scans = [view];
        let (c, _) = compare(&scans);
        let v = c.verdicts;
        let verdicts = v.direct + v.multiple + v.edge + v.min_range + v.silent + v.unexplained;
        proptest::prop_assert_eq!(verdicts, c.beams);
        let split = c.both_echo + c.measured_only + c.simulated_only + c.min_range + c.both_no_echo;
        proptest::prop_assert_eq!(split, c.beams);
        proptest::prop_assert_eq!(c.beams + c.not_compared.total(), sides.len() as u32);
        proptest::prop_assert_eq!(c.agree, v.direct + v.multiple + v.edge);
    }
}
