//! The body on the flange, and contacts of the arm.

use super::{Part, RealArmStudy, pair};
use crate::number::significant;
use crate::report::{Column, Table};

fn chance(probability: f64) -> String {
    if probability < 0.01 { "< 0.01".to_owned() } else { format!("{probability:.2}") }
}

impl RealArmStudy {
    pub(super) fn payload(&self) -> Part {
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
                 Coordinates are those of the last joint's frame. ± is half of the 95 % interval from the scatter of 2 s blocks; errors of \
                 the kinematics and of the gains are not in it.",
            )
            .table("", table)
    }

    pub(super) fn contact(&self) -> Part {
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
}
