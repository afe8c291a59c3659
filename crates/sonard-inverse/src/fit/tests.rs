//! Stages of a fit, each alone.

use super::{
    lm_step::Improved,
    perturbation::{CLOSE, ROUGH, widened},
    *,
};
use crate::{
    candidates::Phases,
    tests::{PLACE, short},
};

/// Calls `check` with the stages of a short fit.
fn with_fitter(check: impl FnOnce(&Fitter)) {
    let (world, sweeps, options) = short(&PLACE);
    let simulators = SimulatorSet::new(&world.with_face_on_axis()).expect("a model");
    let problem = Problem::new(&world, &sweeps, &options).expect("a problem");
    check(&Fitter::new(problem, simulators, &NoObserver));
}

fn optimum(fitter: &Fitter) -> Optimum {
    fitter.fit_from_stage(fitter.problem.zero(), 0).expect("an optimum")
}

/// Reused simulators and linearizations leave no trace.
#[test]
fn posterior_is_a_function_of_the_point() {
    with_fitter(|fitter| {
        let errors = fitter.problem.rough_errors();
        let evaluate = |fitter: &Fitter, values: [f64; 3], phases| {
            let point = Point { phases, ..Point::incoherent(DVector::from_row_slice(&values)) };
            let linear = fitter.linearize(&point).expect("predictions");
            fitter.log_posterior(&linear, &point, &errors).to_bits()
        };
        let here = evaluate(fitter, [0.0; 3], Phases::Unknown);
        let there = evaluate(fitter, [0.02, -0.03, 1.0], Phases::Known);
        assert_ne!(here, there);
        assert_eq!(evaluate(fitter, [0.0; 3], Phases::Unknown), here);
        with_fitter(|other| {
            assert_eq!(evaluate(other, [0.02, -0.03, 1.0], Phases::Known), there);
        });
    });
}

#[test]
fn steps_raise_the_posterior() {
    with_fitter(|fitter| {
        let (problem, errors) = (&fitter.problem, fitter.problem.rough_errors());
        let point = Point::incoherent(problem.zero());
        let linear = fitter.linearize(&point).expect("predictions");
        let on_linearization = |of: &Point| {
            let change = &of.values - &point.values;
            linear.log_likelihood(&change, &errors) + problem.log_prior(&of.values)
        };
        let Improved { point: free, largest } =
            fitter.improve(&linear, &point, &errors, None).expect("steps");
        assert!(on_linearization(&free) > on_linearization(&point) + 1.0);
        assert!(largest > 0.1, "{largest}");
        // With a combination held, the others move.
        let held = problem.position_along(&DVector::from_row_slice(&[0.1, 0.0, 0.0]));
        let Improved { point: bound, .. } =
            fitter.improve(&linear, &point, &errors, Some(&held)).expect("steps");
        let (moved, freely) = (held.dot(&bound.values), held.dot(&free.values));
        assert!(moved.abs() < 0.02 * freely.abs(), "{moved}, {freely}");
        let values = [&point, &bound, &free].map(on_linearization);
        assert!(values.is_sorted(), "{values:?}");
    });
}

#[test]
fn continuation_narrows_the_errors() {
    with_fitter(|fitter| {
        let (mut point, mut errors) =
            (Point::incoherent(fitter.problem.zero()), fitter.problem.rough_errors());
        let widest_m = errors.sigma_m;
        for stage in 0..continuation::STAGES.len() {
            let before = errors;
            (point, errors) =
                fitter.run_continuation(point, errors, [stage].into_iter()).expect("a stage");
            assert!(errors.sigma_m <= before.sigma_m && errors.sigma_db <= before.sigma_db);
        }
        assert!(errors.sigma_m < 0.5 * widest_m, "{}", errors.sigma_m);
    });
}

#[test]
fn optimum_is_stationary() {
    with_fitter(|fitter| {
        let first = optimum(fitter);
        let again = fitter.converge(&first.point, first.errors).expect("an optimum");
        let moved = fitter.problem.largest_share(&(&again.point.values - &first.point.values));
        assert!(again.value >= first.value - 0.01 && moved < 0.05, "{moved}");
    });
}

#[test]
fn refinement_loses_nothing() {
    with_fitter(|fitter| {
        let first = optimum(fitter);
        let value = first.value;
        assert!(fitter.refine(first).expect("an optimum").value >= value);
    });
}

#[test]
fn weak_directions_are_scaled_by_the_priors() {
    with_fitter(|fitter| {
        let problem = &fitter.problem;
        let found = optimum(fitter);
        let errors = widened(&found.errors, ROUGH);
        let directions = fitter.weak_directions(&found.point, &errors).expect("directions");
        assert!(!directions.is_empty());
        for (direction, sigma) in directions {
            let length = direction.component_div(&problem.prior_sigmas()).norm();
            assert!((length - 1.0).abs() < 1e-9, "{length}");
            assert!((0.1..=1.0 + 1e-9).contains(&sigma), "{sigma}");
        }
    });
}

#[test]
fn profile_holds_its_direction() {
    with_fitter(|fitter| {
        let problem = &fitter.problem;
        let found = optimum(fitter);
        let errors = widened(&found.errors, CLOSE);
        let point = Point::incoherent(found.point.values.clone());
        let ridge = fitter.weak_directions(&point, &errors).expect("directions");
        let ridge = ridge
            .first()
            .cloned()
            .unwrap_or_else(|| (DVector::from_row_slice(&[0.0, 0.0, 6.0]), 1.0));
        let steps = fitter.profile(&found, &ridge, (0, 16)).expect("a profile");
        assert!(steps.len() > 8, "{}", steps.len());
        let position = problem.position_along(&ridge.0);
        let positions: Vec<f64> =
            steps.iter().map(|step| position.dot(&(&step.values - &found.point.values))).collect();
        assert!(positions.is_sorted(), "{positions:?}");
    });
}
