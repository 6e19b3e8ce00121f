//! Reasons why a text is not readable as URDF, in words that lead to the place.

/// Attributes that hold numbers, separated by blanks.
const NUMBERS: [&str; 18] = [
    "xyz", "rpy", "value", "ixx", "ixy", "ixz", "iyy", "iyz", "izz", "lower", "upper", "effort",
    "velocity", "damping", "friction", "radius", "length", "size",
];

/// The reason why the parser rejected `text`; `message` is the parser's own.
pub(super) fn reason(text: &str, message: &str) -> String {
    if text.trim().is_empty() {
        return "the file is empty".to_owned();
    }
    let lines = || text.lines().zip(1..);
    for (line, number) in lines() {
        for (name, value) in attributes(line) {
            let bad = |word: &&str| word.parse::<f64>().is_err();
            if NUMBERS.contains(&name)
                && let Some(word) = value.split_whitespace().find(bad)
            {
                return format!("line {number}: {name}=\"{value}\": \"{word}\" is no number");
            }
        }
    }
    if text.contains("<robot") && !text.contains("</robot>") {
        let last = lines().map(|(_, number)| number).last().unwrap_or(1);
        return format!("it ends in line {last} without </robot>; is the file cut off?");
    }
    message.to_owned()
}

/// The `name="value"` pairs of a line.
fn attributes(line: &str) -> impl Iterator<Item = (&str, &str)> {
    line.split_inclusive("=\"").zip(line.split("=\"").skip(1)).filter_map(|(before, behind)| {
        let name = before.trim_end_matches("=\"").rsplit(char::is_whitespace).next()?;
        Some((name, behind.split('"').next()?))
    })
}

#[cfg(test)]
mod tests {
    use super::reason;

    #[test]
    fn the_reason_names_the_place() {
        let file = "<robot>\n<inertial><mass value=\"1\"/>\n<origin xyz=\"0 0,5 0\" rpy=\"0 0 0\"/>\n</robot>";
        assert_eq!(reason(file, ""), "line 3: xyz=\"0 0,5 0\": \"0,5\" is no number");
        assert_eq!(reason(" \n", "No elements found"), "the file is empty");
        let cut = reason("<robot name=\"a\">\n<link name=\"b\"/>\n<joi", "No elements found");
        assert_eq!(cut, "it ends in line 3 without </robot>; is the file cut off?");
        assert_eq!(reason("<robot></robot>", "the parser's words"), "the parser's words");
    }
}
