//! Errors in the description of an arm.

use thiserror::Error;

/// A description of an arm that cannot be used, with the place and the value at fault.
#[derive(Debug, Error)]
pub enum RobotError {
    /// `--robot` is neither built in nor a file.
    #[error(
        "unknown robot \"{name}\"{}: built in are {}; or give a .urdf, .xml (MJCF) or .toml file",
        folder_hint(name), super::file::built_in_names().collect::<Vec<_>>().join(", ")
    )]
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

fn folder_hint(name: &str) -> &'static str {
    if std::path::Path::new(name).is_dir() { ", which is a folder" } else { "" }
}
