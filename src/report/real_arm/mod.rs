//! The case study of a real UR10e: what its logs reveal about the rigid model, for readers who do not know the project.
//!
//! Input: the diagnoses of its logs, alone and in pairs. Output: a [`Page`] or Markdown.

mod drives;
mod gains;
mod surroundings;
mod verdict;

use super::diagnose::residual_axis;
use super::json::Program;
use super::plot::{Axis, Colour, Grid, Mark};
use super::{Column, Page, ReportError, Section, Table, Verdict};
use crate::diagnose::{Cause, Estimate, Finding, Kind, PayloadFinding, Repeated, chance};
use crate::number::{NONE, resolved, significant, with_sigma};
use crate::robot::Arm;

/// A log used in the study.
pub struct Recorded {
    /// File name.
    pub file: String,
    /// Its role in the study.
    pub role: &'static str,
    /// Number of rows used, and number set aside.
    pub rows: [usize; 2],
    /// Length, s.
    pub seconds: f64,
}

/// The comparison of two logs.
pub struct Pair {
    /// File name of the second log.
    pub file: String,
    /// Mass of the body on the flange as the authors of the logs weighed it, kg; `None` without a body.
    pub known_kg: Option<f64>,
    /// Whose drive gains were used.
    pub gains: &'static str,
    /// The body found on the flange.
    pub finding: PayloadFinding,
}

/// All results of the study.
pub struct RealArmStudy {
    /// The arm.
    pub arm: Arm,
    /// The logs.
    pub recorded: Vec<Recorded>,
    /// Diagnosis of the training run with its held-out runs, using the controller's drive gains.
    pub finding: Finding,
    /// The part of the residual that repeats when the training motion is recorded again with a body on the flange.
    pub repeated: Option<Repeated>,
    /// The causes found with the authors' drive gains.
    pub other_gains: Vec<Cause>,
    /// Gains in Nm/A: the controller's and the authors'.
    pub gains_nm_a: [Vec<f64>; 2],
    /// Logs with and without a body on the flange.
    pub pairs: Vec<Pair>,
    /// Contacts found, per log.
    pub contacts: Vec<(String, Vec<Cause>)>,
}

/// A section of the report, for both page and Markdown.
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

/// Mean of the finite values.
fn mean(values: &[f64]) -> f64 {
    let known = || values.iter().filter(|value| value.is_finite());
    known().sum::<f64>() / known().count() as f64
}

fn list(values: &[f64], digits: usize) -> String {
    values.iter().map(|v| significant(*v, digits)).collect::<Vec<_>>().join("  ")
}

fn percents(values: &[f64]) -> String {
    let one = |value: &f64| match value.is_finite() {
        true => format!("{:.0} %", 100.0 * value),
        false => NONE.to_owned(),
    };
    values.iter().map(one).collect::<Vec<_>>().join("  ")
}

/// Value ± half the width of the 95 % interval, or the ends of an interval that is far from even. A value that is known
/// exactly stands by itself.
fn pair(e: &Estimate) -> String {
    let [low, high] = e.ci95;
    let width = high - low;
    if width == 0.0 {
        significant(e.value, 4)
    } else if e.is_uneven() {
        format!("{} … {}", resolved(low, width), resolved(high, width))
    } else {
        with_sigma(e.value, 0.5 * width)
    }
}

impl RealArmStudy {
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

    /// The report as Markdown, without figures.
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
        let pictures = [
            (Axis::linear("torque on the gear", "Nm"), 1, load(1), "Joint 2"),
            (Axis::linear("torque on the gear", "Nm"), 2, load(2), "Joint 3"),
            (Axis::linear("speed", "rad/s"), 0, speed(0), "Joint 1"),
            (Axis::linear("speed", "rad/s"), 4, speed(4), "Joint 5"),
        ];
        for (x, j, values, name) in pictures {
            let residual = residual_axis(finding, j, "residual in the direction of motion");
            let mut grid = Grid::new("", x, residual);
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
            .say(format!(
                "A cause is named when it explains more than its coefficients cost (Schwarz's criterion, with the price \
                 of having looked at every family, joint and shape), when chance explains it with less than {:.2} % over \
                 all tests (Wald, covariance from block sums), and when it keeps at least half of what it explains in \
                 stretches of time left out of the fit, 5 % of its joint's mean square or more. What touched the arm is \
                 taken out before.",
                100.0 * chance::LAW,
            ))
            .say(trap)
            .table("Named causes", super::diagnose::cause_table(diagnosis))
            .table("What was tried in their place", tried)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_intervals_about_the_value_are_written_with_plus_and_minus() {
        let written = |value, ci95| pair(&Estimate { value, unit: "Nm", ci95 });
        assert_eq!(written(11.0, [8.5, 13.5]), "11.0 ± 2.5");
        assert_eq!(written(60000.0, [7758.0, 521_200.0]), "7758 … 521200");
        assert_eq!(written(85.58, [85.58; 2]), "85.58");
    }
}
