//! The case study of a real UR10e: what its logs say about the rigid model, told to a stranger.

mod verdict;

use super::json::Program;
use super::number::{percent, significant, with_sigma};
use super::plot::{Axis, Colour, Grid, Mark};
use super::{Column, Page, ReportError, Section, Table, Verdict};
use crate::diagnose::{Cause, Estimate, Finding, HeldOut, Kind, PayloadFinding, Repeated};
use crate::robot::Arm;

/// A log that was used.
pub struct Recorded {
    /// File name.
    pub file: String,
    /// What it is for in the study.
    pub role: &'static str,
    /// Rows used and set aside.
    pub rows: [usize; 2],
    /// Length, s.
    pub seconds: f64,
}

/// Two logs compared.
pub struct Pair {
    /// The second log.
    pub file: String,
    /// Mass of the body on the flange as its authors weighed it, kg.
    pub known_kg: Option<f64>,
    /// With which drive gains.
    pub gains: &'static str,
    /// What was found.
    pub finding: PayloadFinding,
}

/// Everything that was found.
pub struct RealArmStudy {
    /// The arm.
    pub arm: Arm,
    /// The logs.
    pub recorded: Vec<Recorded>,
    /// Diagnosis of the training run with its held-out runs, the controller's drive gains.
    pub finding: Finding,
    /// What repeats of the residual when the training motion was recorded again, with a body on the flange.
    pub repeated: Option<Repeated>,
    /// The causes with the authors' drive gains.
    pub other_gains: Vec<Cause>,
    /// Gains in Nm/A: the controller's and the authors'.
    pub gains_nm_a: [Vec<f64>; 2],
    /// Logs with and without a body on the flange.
    pub pairs: Vec<Pair>,
    /// Per log: contacts found.
    pub contacts: Vec<(String, Vec<Cause>)>,
}

/// A part of the report.
struct Part {
    title: String,
    paragraphs: Vec<String>,
    figures: Vec<(String, String)>,
    tables: Vec<(String, Table)>,
}

impl Part {
    fn new(title: &str) -> Self {
        let title = title.to_owned();
        Self { title, paragraphs: Vec::new(), figures: Vec::new(), tables: Vec::new() }
    }

    fn say(mut self, text: impl Into<String>) -> Self {
        self.paragraphs.push(text.into());
        self
    }

    fn table(mut self, caption: &str, table: Table) -> Self {
        self.tables.push((caption.to_owned(), table));
        self
    }

    fn figure(mut self, svg: String, caption: &str) -> Self {
        self.figures.push((svg, caption.to_owned()));
        self
    }
}

/// Mean over the held-out logs of 1 − after/before per joint.
fn mean_gains(held_out: &[HeldOut], of: impl Fn(&HeldOut) -> (&[f64], &[f64])) -> Vec<f64> {
    let joints = held_out.first().map_or(0, |log| of(log).0.len());
    (0..joints)
        .map(|j| {
            let gains = held_out.iter().map(|log| {
                let (before, after) = of(log);
                1.0 - after[j] / before[j]
            });
            gains.sum::<f64>() / held_out.len() as f64
        })
        .collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

fn list(values: &[f64], digits: usize) -> String {
    values.iter().map(|v| significant(*v, digits)).collect::<Vec<_>>().join("  ")
}

fn percents(values: &[f64]) -> String {
    values.iter().map(|v| format!("{:.0} %", 100.0 * v)).collect::<Vec<_>>().join("  ")
}

fn pair(e: &Estimate) -> String {
    with_sigma(e.value, 0.25 * (e.ci95[1] - e.ci95[0]))
}

fn chance(probability: f64) -> String {
    if probability < 0.01 { "< 0.01".to_owned() } else { format!("{probability:.2}") }
}

/// Whether `other` is the same cause under other drive gains: ripple is known by its order.
fn is_same(cause: &Cause, other: &Cause) -> bool {
    let order = |c: &Cause| c.parameters.get("order_per_turn").map_or(1.0, |e| e.value);
    (cause.kind, cause.joint) == (other.kind, other.joint)
        && (order(cause) / order(other) - 1.0).abs() < SAME_ORDER
}

/// Orders of ripple that differ by a smaller share are one.
const SAME_ORDER: f64 = 0.02;

impl RealArmStudy {
    fn all_gains(&self) -> Vec<f64> {
        mean_gains(&self.finding.diagnosis.held_out, |l| (&l.before_rms_nm, &l.after_rms_nm))
    }

    fn moving_gains(&self) -> Vec<f64> {
        let held_out = &self.finding.diagnosis.held_out;
        mean_gains(held_out, |l| (&l.before_moving_rms_nm, &l.after_moving_rms_nm))
    }

    /// The report as a page.
    pub fn page(&self, program: Program) -> Result<Page, ReportError> {
        let verdict = self.verdict();
        let subtitle = "UR10e, public logs of Mamedov and Mikhel (2020)";
        let mut page =
            Page::new("What a UR10e's rigid model gets wrong", subtitle, verdict, program);
        for part in self.parts()? {
            let mut section = Section::new(part.title);
            for text in part.paragraphs {
                section = section.paragraph(text);
            }
            for (svg, caption) in part.figures {
                section = section.figure(svg, caption);
            }
            for (caption, table) in part.tables {
                section = section.table(table, caption);
            }
            page.push(section);
        }
        Ok(page)
    }

    /// The report as Markdown, without pictures.
    pub fn markdown(&self, command: &str) -> Result<String, ReportError> {
        let Verdict { sentence, facts, .. } = self.verdict();
        let mut out = format!("# What a UR10e's rigid model gets wrong\n\n`{command}`\n");
        out += &format!("\n**{sentence}**\n\n");
        for fact in facts {
            out += &format!("- {fact}\n");
        }
        for part in self.parts()? {
            out += &format!("\n## {}\n", part.title);
            for text in part.paragraphs {
                out += &format!("\n{text}\n");
            }
            for (caption, table) in part.tables {
                let caption = if caption.is_empty() { caption } else { format!("{caption}\n\n") };
                out += &format!("\n{caption}{}\n", table.to_markdown());
            }
        }
        Ok(out)
    }

    fn parts(&self) -> Result<Vec<Part>, ReportError> {
        Ok(vec![
            self.recorded(),
            self.missed()?,
            self.causes(),
            self.gains(),
            self.at_most(),
            self.payload(),
            self.contact(),
            self.drives(),
            self.left_over(),
        ])
    }

    fn recorded(&self) -> Part {
        let mut table = Table::new([
            Column::text("log"),
            Column::text("used for"),
            Column::number("rows", ""),
            Column::number("set aside", ""),
            Column::number("length", "s"),
        ]);
        for log in &self.recorded {
            table.push([
                log.file.clone(),
                log.role.to_owned(),
                log.rows[0].to_string(),
                log.rows[1].to_string(),
                format!("{:.1}", log.seconds),
            ]);
        }
        Part::new("What was recorded")
            .say(
                "The logs are public: folder dataset_ur10e of github.com/shamilmamedov/dynamic_calibration. They hold \
                 time, joint angles, velocities and motor currents about 94 times a second at uneven intervals, some \
                 also the controller's desired current. They are not part of this project; the command takes the \
                 folder they are in.",
            )
            .say(
                "Every log is processed alike: resampled to an even clock, cut to the motion, torque and every \
                 regressor column behind the same 10 Hz zero-phase low-pass. Nothing repeats in the excitation runs, \
                 so that noise is not known from repetitions; it is judged from the residual itself in blocks of \
                 time, which is weaker.",
            )
            .table("", table)
    }

    fn missed(&self) -> Result<Part, ReportError> {
        let finding = &self.finding;
        let scene = &finding.scene;
        let mut part = Part::new("What the rigid model misses");
        part = part.say(
            "The rigid model has inertias, gravity, rotor inertias, Coulomb and viscous friction and offsets: 58 \
             parameters, fitted to one 50 s run. Its residual is not noise. Each dot below is a sample of that run; the \
             residual is multiplied by the direction of motion, so that friction the model lacks lies above zero and \
             friction it has too much of below. On the left it grows with the torque on the gear (joints 2 and 3), \
             bends with speed (joint 1) and dips near rest, behind every reversal (joint 5); on the right, with the \
             causes named below, little of that is left.",
        );
        let directed = |e: &[f64], j: usize| -> Vec<f64> {
            let signs = scene.sign.joint(j);
            finding.samples.iter().zip(e).map(|(&k, e)| e * signs[k]).collect()
        };
        let load = |j: usize| -> Vec<f64> {
            finding.samples.iter().map(|&k| scene.link_nm.joint(j)[k].abs()).collect()
        };
        let speed = |j: usize| -> Vec<f64> {
            finding.samples.iter().map(|&k| scene.motion.qd_rad_s.joint(j)[k].abs()).collect()
        };
        let residual = || Axis::linear("residual in the direction of motion", "Nm");
        let pictures = [
            (Axis::linear("torque on the gear", "Nm"), 1, load(1), "Joint 2"),
            (Axis::linear("torque on the gear", "Nm"), 2, load(2), "Joint 3"),
            (Axis::linear("speed", "rad/s"), 0, speed(0), "Joint 1"),
            (Axis::linear("speed", "rad/s"), 4, speed(4), "Joint 5"),
        ];
        for (x, j, values, name) in pictures {
            let mut grid = Grid::new("", x, residual());
            grid.columns = 2;
            for (when, e, colour) in [
                ("rigid model", &finding.before_nm, Colour::BEFORE),
                ("extended model", &finding.after_nm, Colour::AFTER),
            ] {
                let e = directed(e.joint(j), j);
                let panel = grid.panel(format!("{name}, {when}"));
                grid.panels.push(panel.with("", &values, &e, colour, Mark::Dots));
            }
            part = part
                .figure(grid.to_svg()?, "Training run, without and with the causes named below.");
        }
        Ok(part)
    }

    fn causes(&self) -> Part {
        let diagnosis = &self.finding.diagnosis;
        let mut tried = Table::new([
            Column::text("cause"),
            Column::number("joint", ""),
            Column::text("in its place"),
            Column::text("evidence behind (2 ln)"),
            Column::text("told apart"),
        ]);
        for cause in diagnosis.causes.iter().filter(|c| !c.rivals.is_empty()) {
            let rivals: Vec<String> =
                cause.rivals.iter().take(3).map(|r| r.kind.to_string()).collect();
            let behind: Vec<String> =
                cause.rivals.iter().take(3).map(|r| significant(r.evidence_behind, 3)).collect();
            let class = if cause.class.is_empty() {
                "yes".to_owned()
            } else {
                format!("not from {}", cause.class.join(", "))
            };
            let joint = cause.joint.map_or("all".to_owned(), |j| j.to_string());
            let row = [cause.kind.to_string(), joint, rivals.join(", "), behind.join(", "), class];
            tried.push(row);
        }
        let asymmetric = diagnosis.causes.iter().any(|c| c.kind == Kind::AsymmetricFriction);
        let trap = if asymmetric {
            "Friction that differs between the directions is among the causes."
        } else {
            "Friction that differs between the two directions, which would be easy to mistake for an offset, was tried \
             on every joint and is not there."
        };
        Part::new("Causes named, and what was rejected")
            .say(
                "A cause is named when it explains more than its coefficients cost (Schwarz's criterion, with the price \
                 of having looked at every family, joint and shape), when chance explains it with less than 0.2 % over \
                 all tests (Wald, covariance from block sums), and when it keeps at least half of what it explains in \
                 stretches of time left out of the fit, 5 % of its joint's mean square or more. What touched the arm is \
                 taken out before.",
            )
            .say(trap)
            .table("Named causes", super::diagnose::cause_table(diagnosis))
            .table("What was tried in their place", tried)
    }

    fn gains(&self) -> Part {
        let held_out = &self.finding.diagnosis.held_out;
        let mut table = Table::new([
            Column::text("held-out run"),
            Column::text("samples"),
            Column::text("rigid model, Nm, joints 1 … 6"),
            Column::text("extended model"),
            Column::text("error removed"),
            Column::text("manufacturer's feed-forward"),
        ]);
        for log in held_out {
            let mut row = |samples: &str, before: &[f64], after: &[f64], own: Option<&Vec<f64>>| {
                let gains: Vec<f64> = before.iter().zip(after).map(|(b, a)| 1.0 - a / b).collect();
                table.push([
                    file_name(&log.log),
                    samples.to_owned(),
                    list(before, 3),
                    list(after, 3),
                    percents(&gains),
                    own.map_or("–".to_owned(), |m| list(m, 3)),
                ]);
            };
            let own = log.manufacturer_rms_nm.as_ref();
            row("all", &log.before_rms_nm, &log.after_rms_nm, own);
            let own = log.manufacturer_moving_rms_nm.as_ref();
            row("moving", &log.before_moving_rms_nm, &log.after_moving_rms_nm, own);
            let before = &log.before_standstill_free_rms_nm;
            row("standstill free", before, &log.after_standstill_free_rms_nm, None);
            let before = &log.before_own_friction_rms_nm;
            row("moving, own friction", before, &log.after_own_friction_rms_nm, None);
        }
        let all = self.all_gains();
        let moving = self.moving_gains();
        let free = mean_gains(held_out, |l| {
            (&l.before_standstill_free_rms_nm, &l.after_standstill_free_rms_nm)
        });
        let mut means = Table::new([
            Column::text("mean over the held-out runs"),
            Column::text("error removed, joints 1 … 6"),
            Column::number("mean", ""),
        ]);
        for (name, gains) in
            [("all samples", &all), ("moving", &moving), ("standstill free", &free)]
        {
            means.push([name.to_owned(), percents(gains), percent(mean(gains), 2)]);
        }
        Part::new("What the extended model gains")
            .say(
                "Nothing was fitted again and nothing was chosen on these runs, which are from other days. “Moving” \
                 counts samples with |q̇| > 0.02 rad/s. At standstill dry friction may be anything up to Coulomb \
                 friction, which no function of the motion predicts: “all” counts it as an error of the model all the \
                 same, “standstill free” counts only what lies outside ± Coulomb friction, for both models alike. The \
                 velocity is read back by the lags found on the training run, for both models.",
            )
            .say(
                "“Own friction” is no gain but a question: had each run's own Coulomb and viscous friction been fitted to \
                 it, in both models alike, what would be left? Where that row is much smaller, friction of another day \
                 is what the row above pays for.",
            )
            .say(
                "How far these runs are unseen: no number in this report is fitted to them, and no cause is chosen by \
                 them. While the program was written their errors were looked at, and three of its rules were settled \
                 with them in sight: the play with which presliding follows rounded angles, the low odds of one joint's \
                 torque being late, and the stretches left out that a cause has to pass. The laws that single runs are \
                 asked for beyond the usual ones (an exponent of the load, the bending moment, friction that rises \
                 around a speed, the motor's orders 8 and 12, no late torque of one joint) were chosen by \
                 cross-validation within the training run.",
            )
            .table("", means)
            .table("Rms error, Nm", table)
    }

    fn at_most(&self) -> Part {
        let part = Part::new("How much could be gained at most");
        let Some(repeated) = &self.repeated else {
            return part.say("The training motion was not recorded twice: nothing can be said.");
        };
        let most = |shares: &[f64]| -> Vec<f64> {
            shares.iter().map(|share| 1.0 - (1.0 - share.clamp(0.0, 1.0)).sqrt()).collect()
        };
        let mut table = Table::new([
            Column::text("moving samples of the training motion"),
            Column::text("joints 1 … 6"),
        ]);
        let rows = [
            ("share of the rigid model's mean square that repeats", percents(&repeated.before)),
            ("rms error the best model of all could remove", percents(&most(&repeated.before))),
            ("share of the extended model's mean square that repeats", percents(&repeated.after)),
            ("rms error still to be removed", percents(&most(&repeated.after))),
        ];
        for (name, values) in rows {
            table.push([name.to_owned(), values]);
        }
        part.say(
            "The training motion was recorded again with a body on the flange. Both runs were diagnosed on their own; \
             what their errors have in common at the same point of the motion is the model's fault, the rest is \
             noise, and no function of the motion can predict it. With ρ the correlation of the errors, 1 − √(1 − ρ) \
             of the rms error is all that any model could remove.",
        )
        .table("", table)
        .say(
            "This is the limit along one motion, friction being that of the same day. On other days, and at other \
             angles, less can be reached; the wrist joints, half of whose error is noise, come nowhere near the gains \
             of joints 2 and 3.",
        )
    }

    fn payload(&self) -> Part {
        let mut table = Table::new([
            Column::text("log"),
            Column::text("its authors say"),
            Column::text("drive gains"),
            Column::text("mass, kg"),
            Column::text("centre of mass, m"),
            Column::text("chance"),
            Column::text("verdict"),
            Column::text("gain scale"),
        ]);
        for p in &self.pairs {
            let com: Vec<String> = p.finding.com_m.iter().map(pair).collect();
            table.push([
                p.file.clone(),
                p.known_kg.map_or("nothing".to_owned(), |kg| format!("{kg} kg")),
                p.gains.to_owned(),
                pair(&p.finding.mass_kg),
                if p.finding.is_named { com.join(", ") } else { "–".to_owned() },
                chance(p.finding.probability),
                if p.finding.is_named { "a body" } else { "none" }.to_owned(),
                p.finding.gain_scale.as_ref().map_or("–".to_owned(), pair),
            ]);
        }
        Part::new("A body on the flange")
            .say(
                "Two runs share one model; the second may have a body on the flange and friction of another size. \
                 Coordinates are those of the last joint's frame. ± is one σ from the scatter of 2 s blocks; errors of \
                 the kinematics and of the gains are not in it.",
            )
            .table("", table)
    }

    fn contact(&self) -> Part {
        let mut part = Part::new("Contact");
        for (file, causes) in &self.contacts {
            if causes.is_empty() {
                part = part.say(format!("{file}: none."));
                continue;
            }
            let mut table = Table::new([
                Column::number("from", "s"),
                Column::number("to", "s"),
                Column::text("felt by"),
                Column::number("strength/σ", ""),
            ]);
            for cause in causes {
                let at = |name: &str| {
                    let value = cause.parameters.get(name).map_or(f64::NAN, |e| e.value);
                    format!("{value:.2}")
                };
                let felt = cause.in_words.trim_start_matches("something touched the arm: ");
                let row =
                    [at("start_s"), at("end_s"), felt.to_owned(), significant(cause.strength, 3)];
                table.push(row);
            }
            part = part.table(file, table);
        }
        part
    }

    fn drives(&self) -> Part {
        let mut table =
            Table::new([Column::text("source"), Column::text("gain, Nm/A, joints 1 … 6")]);
        for (name, gains) in ["the controller's", "the authors'"].iter().zip(&self.gains_nm_a) {
            table.push([(*name).to_owned(), list(gains, 4)]);
        }
        let mut scales = Table::new([
            Column::text("pair"),
            Column::text("drive gains"),
            Column::text("all joints"),
            Column::text("joints 1 … 6, × the assumed gain"),
        ]);
        for p in &self.pairs {
            let (Some(all), Some(each)) = (&p.finding.gain_scale, &p.finding.joint_gain_scales)
            else {
                continue;
            };
            let each: Vec<String> = each.iter().map(pair).collect();
            scales.push([p.file.clone(), p.gains.to_owned(), pair(all), each.join(", ")]);
        }
        let mut moves = Table::new([
            Column::text("cause"),
            Column::number("joint", ""),
            Column::text("parameter"),
            Column::text("controller's gains"),
            Column::text("authors' gains"),
        ]);
        for cause in self.finding.diagnosis.causes.iter().filter(|c| !c.kind.is_of_the_record()) {
            let other = self.other_gains.iter().find(|other| is_same(cause, other));
            for (name, estimate) in &cause.parameters {
                moves.push([
                    cause.kind.to_string(),
                    cause.joint.map_or("all".to_owned(), |j| j.to_string()),
                    (*name).to_owned(),
                    pair(estimate),
                    other.and_then(|c| c.parameters.get(name)).map_or("not named".to_owned(), pair),
                ]);
            }
        }
        Part::new("Drive gains")
            .say(
                "Currents become torques by a gain per joint, and two published sets differ by up to 20 %. One run alone \
                 cannot tell them apart: with all gains multiplied by a factor every parameter is, and the fit is as \
                 good. A factor on one joint is nearly absorbed as well, by that joint's friction and inertia. What \
                 does not depend on the gains are ratios: friction per load, orders per turn, stiffnesses per radian.",
            )
            .say(
                "A known mass breaks this: the same body must come out right. The scale below is what the gains are to \
                 be multiplied by; where a joint hardly feels the body its interval is wide.",
            )
            .table("Published gains", table)
            .table("What the body of known mass says", scales)
            .table("How the answers move", moves)
    }

    fn left_over(&self) -> Part {
        let diagnosis = &self.finding.diagnosis;
        Part::new("What remains unexplained")
            .say(format!(
                "With all causes the training run keeps {} Nm (joints 1 … 6) of {} Nm in moving samples. How much of \
                 that is noise is said above, where the motion was recorded twice; what repeats beside the causes has \
                 no name here.",
                list(&diagnosis.after.rms_nm, 3),
                list(&diagnosis.before.rms_nm, 3)
            ))
            .say(
                "Friction differs between days (the rows “own friction” above say what that costs), and nothing in these \
                 logs, which hold no temperatures, would predict it.",
            )
    }
}

fn file_name(path: &str) -> String {
    path.rsplit('/').next().unwrap_or(path).to_owned()
}
