//! Texts that the parser rejects: what it asks for too much is supplied, and what is wrong is put into words that lead
//! to the place.

use roxmltree::{Document, Node, ParsingOptions};

/// Attributes that hold numbers, separated by blanks.
const NUMBERS: [&str; 18] = [
    "xyz", "rpy", "value", "ixx", "ixy", "ixz", "iyy", "iyz", "izz", "lower", "upper", "effort",
    "velocity", "damping", "friction", "radius", "length", "size",
];

const JOINT_TYPES: [&str; 7] =
    ["revolute", "continuous", "prismatic", "fixed", "floating", "planar", "spherical"];

const SHAPES: [&str; 5] = ["box", "cylinder", "capsule", "sphere", "mesh"];

/// The text with a speed limit of 0, which stands for an unknown one, in every `<limit>` without; `None` if none lacks
/// it.
pub(super) fn with_velocities(text: &str) -> Option<String> {
    let document = parsed(text).ok()?;
    let limits = parts(&document)
        .flat_map(|part| part.children())
        .filter(|node| node.has_tag_name("limit") && node.attribute("velocity").is_none());
    let mut completed = text.to_owned();
    let starts: Vec<usize> = limits.map(|limit| limit.range().start).collect();
    // From the last to the first, the places of the others stay what they are.
    for start in starts.iter().rev() {
        let tag = text.get(*start..)?;
        let end = tag.find(|c: char| c.is_whitespace() || "/>".contains(c))?;
        completed.insert_str(start + end, " velocity=\"0\"");
    }
    (!starts.is_empty()).then_some(completed)
}

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
    match parsed(text) {
        Ok(document) => first_gap(&document).unwrap_or_else(|| message.to_owned()),
        Err(fault) => fault.to_string(),
    }
}

fn parsed(text: &str) -> Result<Document<'_>, roxmltree::Error> {
    // The parser of URDFs skips a document type declaration too.
    let options = ParsingOptions { allow_dtd: true, ..ParsingOptions::default() };
    Document::parse_with_options(text, options)
}

/// The links and joints. Other programs' elements in a URDF may contain elements of the same names.
fn parts<'a, 'input>(document: &'a Document<'input>) -> impl Iterator<Item = Node<'a, 'input>> {
    document
        .root_element()
        .children()
        .filter(|node| node.has_tag_name("link") || node.has_tag_name("joint"))
}

/// The first place of a link or joint at which something is missing or an unknown word stands.
fn first_gap(document: &Document<'_>) -> Option<String> {
    parts(document).find_map(|part| {
        part.descendants().filter(|node| node.is_element()).find_map(|node| {
            let gap = gap(&node)?;
            let line = document.text_pos_at(node.range().start).row;
            let kind = part.tag_name().name();
            let place = match part.attribute("name") {
                Some(name) => format!("{kind} \"{name}\""),
                None => format!("<{kind}>"),
            };
            Some(format!("line {line}: {place}: {gap}"))
        })
    })
}

/// What is missing or unknown in an element of a link or joint.
fn gap(node: &Node<'_, '_>) -> Option<String> {
    let (attributes, elements): (&[&str], &[&str]) = match node.tag_name().name() {
        "link" | "material" => (&["name"], &[]),
        "joint" => (&["name", "type"], &["parent", "child"]),
        "parent" | "child" => (&["link"], &[]),
        "axis" => (&["xyz"], &[]),
        "mimic" => (&["joint"], &[]),
        "safety_controller" => (&["k_velocity"], &[]),
        "inertial" => (&[], &["mass", "inertia"]),
        "mass" => (&["value"], &[]),
        "inertia" => (&["ixx", "ixy", "ixz", "iyy", "iyz", "izz"], &[]),
        "visual" | "collision" => (&[], &["geometry"]),
        "box" => (&["size"], &[]),
        "cylinder" | "capsule" => (&["radius", "length"], &[]),
        "sphere" => (&["radius"], &[]),
        "mesh" | "texture" => (&["filename"], &[]),
        "color" => (&["rgba"], &[]),
        _ => (&[], &[]),
    };
    let tag = node.tag_name().name();
    let holds = |tag: &str| node.children().any(|child| child.has_tag_name(tag));
    if let Some(attribute) = attributes.iter().find(|name| node.attribute(**name).is_none()) {
        return Some(format!("<{tag}> has no {attribute}=\"…\""));
    }
    if let Some(element) = elements.iter().find(|element| !holds(element)) {
        return Some(format!("<{tag}> has no <{element}>"));
    }
    match (tag, node.attribute("type")) {
        ("joint", Some(kind)) if !JOINT_TYPES.contains(&kind) => {
            Some(format!("type=\"{kind}\" is none of {}", JOINT_TYPES.join(", ")))
        }
        ("geometry", _) if !SHAPES.iter().any(|shape| holds(shape)) => {
            Some(format!("<geometry> has none of {}", SHAPES.join(", ")))
        }
        _ => None,
    }
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
    use super::{reason, with_velocities};

    #[test]
    fn the_reason_names_the_place() {
        let file = "<robot>\n<inertial><mass value=\"1\"/>\n<origin xyz=\"0 0,5 0\" rpy=\"0 0 0\"/>\n</robot>";
        assert_eq!(reason(file, ""), "line 3: xyz=\"0 0,5 0\": \"0,5\" is no number");
        assert_eq!(reason(" \n", "No elements found"), "the file is empty");
        let cut = reason("<robot name=\"a\">\n<link name=\"b\"/>\n<joi", "No elements found");
        assert_eq!(cut, "it ends in line 3 without </robot>; is the file cut off?");
        assert_eq!(reason("<robot></robot>", "the parser's words"), "the parser's words");
        let open = reason("<robot>\n<link name=\"a\">\n</robot>", "the parser's words");
        assert!(open.contains("link") && open.contains("3:"), "{open}");
    }

    #[test]
    fn what_is_missing_is_named_with_its_link_or_joint() {
        let of = |part: &str| reason(&format!("<robot>\n\n{part}\n</robot>"), "the parser's words");
        let joint = |inside: &str| format!("<joint name=\"j\" type=\"fixed\">\n{inside}</joint>");
        let ends = "<parent link=\"a\"/><child link=\"b\"/>";
        for (part, expected) in [
            ("<link/>".to_owned(), "line 3: <link>: <link> has no name=\"…\""),
            (joint("<parent link=\"a\"/>"), "line 3: joint \"j\": <joint> has no <child>"),
            (joint(&format!("{ends}<mimic/>")), "line 4: joint \"j\": <mimic> has no joint=\"…\""),
            (
                joint(ends).replace("fixed", "revolut"),
                "line 3: joint \"j\": type=\"revolut\" is none of revolute, continuous, prismatic, fixed, floating, \
                 planar, spherical",
            ),
            (
                "<link name=\"l\"><inertial><inertia ixx=\"1\"/></inertial></link>".to_owned(),
                "line 3: link \"l\": <inertial> has no <mass>",
            ),
            (
                "<link name=\"l\"><visual><geometry><cone/></geometry></visual></link>".to_owned(),
                "line 3: link \"l\": <geometry> has none of box, cylinder, capsule, sphere, mesh",
            ),
            // Not a joint of the robot.
            ("<transmission><joint name=\"j\"/></transmission>".to_owned(), "the parser's words"),
            (joint(ends), "the parser's words"),
        ] {
            assert_eq!(of(&part), expected);
        }
    }

    #[test]
    fn a_missing_speed_limit_is_unknown() {
        let text = "<robot><joint><limit\nlower=\"1\"/></joint><joint><limit velocity=\"1\"/><limit/></joint></robot>";
        let completed = text
            .replace("<limit\n", "<limit velocity=\"0\"\n")
            .replace("<limit/>", "<limit velocity=\"0\"/>");
        assert_eq!(with_velocities(text), Some(completed));
        assert_eq!(with_velocities("<robot><limit/></robot>"), None);
    }
}
