//! Errors in the description of an arm.

use std::path::Path;

use thiserror::Error;

/// A description of an arm that cannot be used, with the place and the value at fault.
#[derive(Debug, Error)]
pub enum RobotError {
    /// `--robot` is neither built in nor a file.
    #[error("unknown robot \"{name}\"{}", what_to_give(name))]
    UnknownName {
        /// What was asked for.
        name: String,
    },
    /// The file could not be read.
    #[error("{file}: {source}")]
    Read {
        /// The file.
        file: String,
        /// Why.
        source: std::io::Error,
    },
    /// Not valid TOML, or a key that robot files do not have.
    #[error("{file}: {message}")]
    Toml {
        /// The file.
        file: String,
        /// The parser's message with line and key.
        message: String,
    },
    /// Not valid URDF.
    #[error("{file}: not readable as URDF: {message}")]
    Urdf {
        /// The file.
        file: String,
        /// The parser's message.
        message: String,
    },
    /// A valid URDF, but not of an arm that this program can work with.
    #[error("{file}: {fault}")]
    UrdfArm {
        /// The file.
        file: String,
        /// What is wrong, where, and what to do.
        fault: super::urdf::UrdfFault,
    },
    /// Not a valid MJCF, or not of an arm that this program can work with.
    #[error("{file}: {fault}")]
    Mjcf {
        /// The file.
        file: String,
        /// What is wrong, where, and what to do.
        fault: super::mjcf::MjcfFault,
    },
    /// A readable file, but not of an arm that this program can work with.
    #[error("{file}: {what}")]
    Invalid {
        /// The file.
        file: String,
        /// What is wrong, where, and what to do.
        what: String,
    },
}

/// What to give in place of `name`, with a leading punctuation mark.
fn what_to_give(name: &str) -> String {
    if let Some((xacro, urdf)) = expanded(name) {
        return format!(": expand it first (xacro {xacro} > {urdf}), and give {urdf}");
    }
    let folder = if Path::new(name).is_dir() { ", which is a folder" } else { "" };
    let built_in: Vec<&str> = super::file::built_in_names().collect();
    format!(
        "{folder}: built in are {}; or give a .urdf, .xml (MJCF) or .toml file",
        built_in.join(", ")
    )
}

/// The xacro file that `name` is, perhaps with a link behind it, and a name for the URDF that it expands to; `None` if
/// `name` is no xacro file.
fn expanded(name: &str) -> Option<(&str, String)> {
    let ends_in = |path: &Path, end: &str| {
        path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case(end))
    };
    let before_link = name.rsplit_once('#').map_or(name, |(file, _)| file);
    let xacro = [name, before_link].into_iter().find(|file| ends_in(Path::new(file), "xacro"))?;
    let stem = Path::new(xacro).with_extension("");
    let urdf = match ends_in(&stem, "urdf") {
        true => stem,
        false => Path::new(xacro).with_extension("urdf"),
    };
    Some((xacro, urdf.display().to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_xacro_file_is_to_be_expanded() {
        let message = |name: &str| RobotError::UnknownName { name: name.to_owned() }.to_string();
        for (name, command) in [
            ("arm.xacro", "(xacro arm.xacro > arm.urdf)"),
            ("arm.urdf.xacro", "(xacro arm.urdf.xacro > arm.urdf)"),
            ("cell/my.arm.XACRO#tool0", "(xacro cell/my.arm.XACRO > cell/my.arm.urdf)"),
        ] {
            let message = message(name);
            assert!(message.contains(command) && !message.contains("ur10e"), "{message}");
        }
        for name in ["ur9", "xacro", "arm.xacro.yaml"] {
            assert!(message(name).contains("built in are ur5, ur10e"), "{name}");
        }
    }
}
