//! An effect means the same in the diagnosis and in the plant, which share no formula: a family's coefficients are
//! converted to physical parameters, these to an effect, the plant produces a log with it, and the family must predict
//! the torque of that log with the original coefficients.
//!
//! Along a log without noise, c = ⟨d, τ − τ₀⟩/⟨d, d⟩, with d the torque that the family predicts and τ₀ the torque of
//! the arm without the effect, is 1 if both mean the same, and −1 or worse if a sign, a phase, a unit or a factor
//! differs. The arm's rigid torque is not exact along a sampled motion (its acceleration is a short series, and
//! friction reverses between samples), but its error does not resemble d: it changes c by its size relative to d,
//! divided by the root of the 20 or so independent stretches of a motion of ±5 reversals, 2 % where it is as large as
//! d.

use std::collections::BTreeMap;
use std::sync::OnceLock;

use armid::base::{BaseSet, Parameterisation};
use armid::diagnose::candidates::{self, Candidate, Shape};
use armid::diagnose::replay::{Counterpart, Fitted};
use armid::diagnose::{Effect, Extension, Kind, Scene};
use armid::dynamics::Model;
use armid::excitation::FourierSeries;
use armid::identify::{Identifier, Measurement, Options, Regression};
use armid::plant::faults::{self, EncoderSide, FaultyPlant};
use armid::plant::{PlantConfig, Recording};
use armid::robot::Arm;

use crate::simulated::Periodic;

const PERIOD: usize = 1250;
const LEAD: usize = 125;
const PERIODS: usize = 2;
/// Largest |c − 1| of a family with the same law as the plant.
const SAME: f64 = 0.05;

/// One family at one joint (from 1; 0: all), and the tolerance of c around 1.
struct Case {
    kind: Kind,
    joint: usize,
    shape: Shape,
    coefficients: Vec<f64>,
    within: f64,
}

fn case(kind: Kind, joint: usize, shape: (usize, f64), coefficients: &[f64], within: f64) -> Case {
    let shape = Shape { variant: shape.0, value: shape.1 };
    Case { kind, joint, shape, coefficients: coefficients.to_vec(), within }
}

impl Case {
    /// The case as an effect that was fitted.
    fn effect(&self) -> Effect {
        let families = candidates::all();
        Effect {
            family: families.iter().position(|family| family.kind() == self.kind).unwrap(),
            site: self.joint.checked_sub(1),
            shape: self.shape,
            coefficients: self.coefficients.clone(),
            off: Vec::new(),
            absorbed: Vec::new(),
        }
    }
}

/// What `effects` along `scene` are in the plant.
fn in_plant(scene: &Scene, effects: &[Effect]) -> Vec<Counterpart> {
    let fitted = Fitted::all(effects, &candidates::all(), scene);
    fitted.into_iter().map(|fitted| fitted.counterpart).collect()
}

struct Bench {
    arm: Arm,
    model: Model,
    set: BaseSet,
    clean: Recording,
}

impl Bench {
    /// The common bench of all tests in this file.
    fn get() -> &'static Self {
        static BENCH: OnceLock<Bench> = OnceLock::new();
        BENCH.get_or_init(|| {
            let arm = Arm::built_in("ur5").unwrap();
            let set = BaseSet::find(&arm, Parameterisation::full(arm.dof(), false)).unwrap();
            Self { model: Model::new(&arm), clean: log(&arm, &[]), set, arm }
        })
    }

    /// The scene along the motion of the arm without effects.
    fn clean_scene(&self) -> Scene {
        self.scene(&self.clean).0
    }

    /// The scene that every family gets for `run`, with the true parameters.
    fn scene(&self, run: &Recording) -> (Scene, Regression) {
        let mut identifier = Identifier::new(&self.model, &self.set, Options::default());
        let measurement = Measurement {
            source: "val_replay",
            time_s: &run.time_s,
            q_rad: &run.q_rad,
            qd_rad_s: &run.qd_rad_s,
            torque_nm: &run.torque_nm,
        };
        let regression = identifier.regression(&measurement).unwrap();
        let theta = self.set.values(&self.model.standard_parameters());
        (Scene::new(&self.arm, &self.set, &theta, &regression.prepared), regression)
    }

    /// c, and the rms of d over the joints that it acts on, Nm.
    fn slope(&self, case: &Case) -> (f64, f64) {
        let families = candidates::all();
        let effects = [case.effect()];
        let found = in_plant(&self.clean_scene(), &effects);
        let [Counterpart::InTheModel(hidden)] = &found[..] else {
            panic!("{} has no counterpart", case.kind);
        };
        let run = log(&self.arm, std::slice::from_ref(hidden));
        let (scene, regression) = self.scene(&run);
        let theta = self.set.values(&self.model.standard_parameters());
        let predict = |effects: Vec<Effect>| {
            let (theta, instant_s) = (theta.clone(), scene.instant_s());
            let model =
                Extension { theta, answers: Vec::new(), instant_s, effects, told: Vec::new() };
            model.torque_nm(&families, &scene, &regression.problem, None)
        };
        let (with, without) = (predict(effects.into()), predict(Vec::new()));
        let torque = &regression.prepared.torque_nm;
        let n = regression.problem.samples;
        let (mut product, mut square, mut count) = (0.0, 0.0, 0);
        for j in 0..self.arm.dof() {
            for k in 0..n {
                let d = with.joint(j)[k] - without.joint(j)[k];
                let periods = torque.joint(j).iter().skip(k).step_by(n);
                let mean = periods.sum::<f64>() / PERIODS as f64;
                product += d * (mean - without.joint(j)[k]);
                square += d * d;
                count += usize::from(d != 0.0);
            }
        }
        (product / square, (square / count as f64).sqrt())
    }

    fn check(&self, cases: &[Case]) {
        let mut wrong = Vec::new();
        for case in cases {
            let (slope, rms_nm) = self.slope(case);
            let Case { kind, joint, shape, within, .. } = case;
            let variant = shape.variant;
            println!("{kind:20} {variant} joint {joint}: c = {slope:.3}, d {rms_nm:.3} Nm rms");
            // NaN also counts as wrong.
            let is_right = (slope - 1.0).abs() <= *within;
            if !is_right {
                wrong.push((kind, variant, joint, slope));
            }
        }
        assert!(wrong.is_empty(), "{wrong:?}");
    }
}

/// Two periods without noise. A run that repeats is integrated for one period, entered a second before.
fn log(arm: &Arm, effects: &[faults::Effect]) -> Recording {
    let series = FourierSeries::built_in("ur5_identification").unwrap();
    let repeats = effects.iter().all(faults::Effect::repeats);
    let (lead, periods) = if repeats { (LEAD, 1) } else { (0, PERIODS) };
    let reference = Periodic { series, lead_s: lead as f64 / 125.0, periods };
    let plant = FaultyPlant::new(arm, effects, &PlantConfig::default()).unwrap();
    let run = plant.run(&reference, None).unwrap();
    run.repeated(lead + periods * PERIOD, PERIOD, lead + PERIODS * PERIOD, 125.0)
}

const NO_SHAPE: (usize, f64) = (0, 0.0);

fn friction(arm: &Arm) -> Vec<Case> {
    let carried_nm = arm.joints[4].drive.coulomb_nm;
    vec![
        // A peak that is passed in two or three samples: the sampled speeds cut a few percent off its top.
        case(Kind::Stribeck, 4, (0, 0.15), &[0.8], 0.1),
        case(Kind::Stribeck, 5, (1, 0.2), &[0.8], 0.1),
        case(Kind::Stribeck, 5, (2, 0.2), &[0.8], 0.1),
        case(Kind::NonlinearViscous, 2, (0, 0.5), &[3.0], SAME),
        case(Kind::NonlinearViscous, 3, (1, 2.0), &[3.0], SAME),
        case(Kind::AsymmetricFriction, 3, NO_SHAPE, &[1.5, 1.0], SAME),
        case(Kind::LoadFriction, 2, NO_SHAPE, &[0.08], SAME),
        // A drive that delivers the friction of the robot file jolts the other joints; the diagnosis takes that for the
        // response of the drive.
        case(Kind::ReversalWidth, 5, (0, 0.2), &[0.2], SAME),
        // The same behind a drive that delivers the friction of the file. Between two samples, the velocities in the two
        // variants differ by what friction makes of the rotor in half a sample, 1.5 Nm/0.25 kg m² · 4 ms: a ninth of the
        // width.
        case(Kind::ReversalWidth, 5, (1, 0.2), &[0.2], SAME + 0.11),
        case(Kind::PositionFriction, 1, NO_SHAPE, &[1.5, -2.0], SAME),
        // The bristles carry the friction of the arm.
        case(Kind::Presliding, 5, (0, 100.0), &[carried_nm], SAME),
        // The same bristles, damped: σ₁/σ₀ is 5 ms.
        case(Kind::Presliding, 5, (4, 100.0), &[carried_nm, 0.005 * carried_nm], SAME),
        // The plant heats by the power of friction, the family by time.
        case(Kind::ThermalDrift, 1, (0, 15.0), &[-0.3], SAME),
    ]
}

fn drives() -> Vec<Case> {
    vec![
        case(Kind::Ripple, 4, (0, 40.0), &[0.5, -0.4], SAME),
        case(Kind::TorqueGain, 2, NO_SHAPE, &[0.08], SAME),
        case(Kind::CurrentOffset, 4, NO_SHAPE, &[0.5], SAME),
        case(Kind::Saturation, 2, (0, 40.0), &[1.0], SAME),
        // Without noise, it is the same whether noise is cut off as well.
        case(Kind::Saturation, 2, (1, 40.0), &[1.0], SAME),
        case(Kind::TimeSkew, 2, (0, 0.004), &[0.004], SAME),
        // At the wrists most of the change comes from friction where it reverses, within less than a sample.
        case(Kind::TimeSkew, 0, (0, -0.004), &[-0.004], 0.15),
        // The plant's controller always leaves a tenth of friction to the feedback: c is 1 + 0.1/0.9 if both mean the
        // same.
        case(Kind::FeedForward, 1, NO_SHAPE, &[0.9], 0.1 / 0.9 + SAME),
    ]
}

fn arm_and_surroundings() -> Vec<Case> {
    vec![
        case(Kind::Spring, 3, NO_SHAPE, &[6.0, -4.0], SAME),
        // The pull at zero alone is an offset.
        case(Kind::Spring, 3, (1, 0.0), &[-4.0], SAME),
        case(Kind::BaseTilt, 0, NO_SHAPE, &[0.02, -0.03], SAME),
        case(Kind::EncoderOffset, 2, NO_SHAPE, &[0.02], SAME),
        // A thousandth of the link, so that its square is as much of its effect.
        case(Kind::LinkLength, 3, NO_SHAPE, &[5e-4], SAME),
        case(Kind::Gravity, 0, NO_SHAPE, &[-0.02], SAME),
    ]
}

fn gears() -> Vec<Case> {
    vec![
        // The gear bends alike in both. How the drives damp its swing is a guess in the family, with an error of 0.15:
        // it may change c by 0.1 even if the swing were two thirds of d.
        case(Kind::Elasticity, 2, (0, 8000.0), &[1.0 / 8000.0], 0.1),
        // The same gear, driven by what is known of its load ten times better than the noise.
        case(Kind::Elasticity, 2, (1, 8000.0), &[1.0 / 8000.0], 0.1),
    ]
}

#[test]
fn friction_means_the_same() {
    let bench = Bench::get();
    bench.check(&friction(&bench.arm));
}

#[test]
fn drives_mean_the_same() {
    Bench::get().check(&drives());
}

#[test]
fn arm_and_surroundings_mean_the_same() {
    Bench::get().check(&arm_and_surroundings());
}

#[test]
fn gears_mean_the_same() {
    Bench::get().check(&gears());
}

/// Over the whole band, the ringing of the plant's tooth flanks hides the flight across the gap (c = 0.01; with other
/// flanks up to 0.46). For play, only the parameter is therefore compared: the gap from flank to flank in both.
/// `val_faults` checks that the plant has half of it to either side, `blind_benchmark` the interval that is found.
#[test]
fn play_means_the_same() {
    let gap_rad = 0.004;
    let scene = Bench::get().clean_scene();
    let hidden = faults::Effect::Backlash(faults::Backlash::new(2, gap_rad));
    // The flanks are the plant's own, whatever those of the variant are.
    for variant in [0, 1, 26] {
        let play = case(Kind::Backlash, 2, (variant, gap_rad), &[gap_rad], SAME);
        let expected = [Counterpart::InTheModel(hidden.clone())];
        assert_eq!(in_plant(&scene, &[play.effect()]), expected);
    }
}

/// With the encoder on the link, the drive of the plant is unstable, or swings on the gear, so that c says nothing (−0.2
/// with a damping ratio of 0.3): what is compared there is the effect itself. The stiffness is a power of two, whose inverse is exact.
#[test]
fn gears_keep_their_encoder_and_their_damping() {
    let scene = Bench::get().clean_scene();
    let (motor, link) = (EncoderSide::Motor, EncoderSide::Link);
    let variants =
        [(motor, 0.05), (motor, 0.05), (link, 0.05), (link, 0.3), (link, 0.05), (link, 0.3)];
    for (variant, (encoder, damping_ratio)) in variants.into_iter().enumerate() {
        let stiffness_nm_rad = 8192.0;
        let compliance = 1.0 / stiffness_nm_rad;
        let gear =
            case(Kind::Elasticity, 2, (variant, stiffness_nm_rad), &[compliance], SAME).effect();
        let hidden = faults::Elasticity { joint: 2, stiffness_nm_rad, damping_ratio, encoder };
        let expected = [Counterpart::InTheModel(faults::Effect::Elasticity(hidden))];
        assert_eq!(in_plant(&scene, &[gear]), expected, "{variant}");
    }
}

/// Ripple that the drive answers is in the torque at once. How fast the drive of the plant answers it is the plant's
/// own, so that both variants are one effect.
#[test]
fn ripples_are_the_same_whether_or_not_a_drive_answers_them() {
    let scene = Bench::get().clean_scene();
    let of_variant = |variant| {
        let ripple = case(Kind::Ripple, 4, (variant, 100.0), &[0.5, -0.4], SAME).effect();
        in_plant(&scene, &[ripple])
    };
    assert!(matches!(of_variant(0)[..], [Counterpart::InTheModel(_)]));
    assert_eq!(of_variant(0), of_variant(1));
}

/// The variants of presliding differ in the drive that answers it, and from the fifth on they are damped. The drive of
/// the plant is its own, so that c is compared for one of them; the bristles are those of the variant.
#[test]
fn bristles_are_the_same_behind_every_drive() {
    let scene = Bench::get().clean_scene();
    for variant in 0..8 {
        let damping_s = if variant < 4 { 0.0 } else { 0.25 };
        let coefficients = [2.0, 2.0 * damping_s];
        let columns = if variant < 4 { 1 } else { 2 };
        let bristles =
            case(Kind::Presliding, 5, (variant, 100.0), &coefficients[..columns], SAME).effect();
        let hidden = faults::Presliding { joint: 5, stiffness_per_rad: 100.0, damping_s };
        let expected = [Counterpart::InTheModel(faults::Effect::Presliding(hidden))];
        assert_eq!(in_plant(&scene, &[bristles]), expected, "{variant}");
    }
}

/// In the model, joint 3 has the width of the robot's file, 0.02 rad/s, and what the arm and the joint add to it. In
/// the plant, a width replaces those before it.
#[test]
fn the_width_of_a_joint_holds_that_of_the_arm() {
    let bench = Bench::get();
    let scene = bench.clean_scene();
    let wider = |joint: usize, by_rad_s: f64| {
        case(Kind::ReversalWidth, joint, (0, by_rad_s), &[by_rad_s], SAME).effect()
    };
    let widths = |effects: &[Effect]| -> Vec<(Option<usize>, f64)> {
        let width = |counterpart: Counterpart| match counterpart {
            Counterpart::InTheModel(faults::Effect::ReversalWidth(turn)) => {
                (turn.joint, turn.width_rad_s)
            }
            other => panic!("{other:?}"),
        };
        in_plant(&scene, effects).into_iter().map(width).collect()
    };
    let [arm, joint, other] = [wider(0, 0.02), wider(3, 0.025), wider(5, -0.01)];
    for effects in [[arm.clone(), joint.clone()], [joint.clone(), arm]] {
        let found = widths(&effects);
        let [(None, of_arm), (Some(3), of_joint)] = &found[..] else { panic!("{found:?}") };
        // Sums of two and three numbers below 0.1, which are rounded to 1e-17.
        let off = (of_arm - 0.04).abs().max((of_joint - 0.065).abs());
        assert!(off < 1e-15, "{found:?}");
    }
    // Without a width of the arm, each joint has its own, in the order in which they were found.
    let found = widths(&[joint, other]);
    let [(Some(3), third), (Some(5), fifth)] = &found[..] else { panic!("{found:?}") };
    assert!((third - 0.045).abs().max((fifth - 0.01).abs()) < 1e-15, "{found:?}");
}

/// A law that looks like an effect of the plant and means something else is not simulated as one.
#[test]
fn other_laws_have_no_counterpart() {
    let scene = Bench::get().clean_scene();
    for (kind, variant, of) in [
        (Kind::TimeSkew, 1, "a low-pass"),
        (Kind::LoadFriction, 2, "the load of the motor"),
        (Kind::LoadFriction, 3, "another rotor"),
        (Kind::NonlinearViscous, 2, "friction that rises around a speed"),
    ] {
        let law = case(kind, 2, (variant, 0.5), &[0.1, 0.1], SAME).effect();
        let found = in_plant(&scene, &[law]);
        assert!(matches!(found[..], [Counterpart::None(_)]), "{kind} of {of}: {found:?}");
    }
}

/// A shape of every variant of a family along `scene`, at joint 2 or the arm as a whole (0).
fn variants(family: &dyn Candidate, scene: &Scene) -> (usize, BTreeMap<usize, Shape>) {
    let sites = family.sites(scene.joints());
    let site = sites.contains(&Some(1)).then_some(1);
    let shapes = family.shapes(scene, site);
    let finer = shapes.iter().flat_map(|shape| family.finer_shapes(scene, site, *shape));
    let all = shapes.iter().copied().chain(finer).chain(family.richer_shapes(scene));
    (site.map_or(0, |j| j + 1), all.map(|shape| (shape.variant, shape)).collect())
}

/// Every variant that has a counterpart is compared: along a log or, where the test above its kind says why, by its
/// parameters alone. Of every family but play, some variant is compared along a log.
#[test]
fn no_variant_is_left_out() {
    let bench = Bench::get();
    let scene = bench.clean_scene();
    let cases = [friction(&bench.arm), drives(), arm_and_surroundings(), gears()];
    for family in candidates::all() {
        let kind = family.kind();
        let of_kind: Vec<&Case> = cases.iter().flatten().filter(|case| case.kind == kind).collect();
        assert!(!of_kind.is_empty() || kind == Kind::Backlash, "{kind} has no case");
        let (joint, shapes) = variants(&*family, &scene);
        assert!(!shapes.is_empty(), "{kind} has no shape");
        for (variant, shape) in shapes {
            // An effect of a size that the plant can have.
            let (coefficients, within) = (vec![0.1, 0.1], SAME);
            let effect = Case { kind, joint, shape, coefficients, within }.effect();
            let is_simulated =
                matches!(in_plant(&scene, &[effect])[..], [Counterpart::InTheModel(_)]);
            let is_compared = of_kind.iter().any(|case| case.shape.variant == variant);
            let by_parameters = match kind {
                Kind::Backlash | Kind::Presliding => true,
                Kind::Elasticity => variant >= 2,
                Kind::Ripple => variant == 1,
                _ => false,
            };
            assert!(
                !is_simulated || is_compared || by_parameters,
                "variant {variant} of {kind} has no case"
            );
        }
    }
}
