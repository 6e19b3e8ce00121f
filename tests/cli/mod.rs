//! Runs the programs as a user does: by command line, each test in a folder of its own.

mod described;

use std::path::PathBuf;
use std::process::{Command, Output};

use serde_json::Value;
use tempfile::TempDir;

pub use described::{keys, words};

/// The default scenario with this number of periods.
pub fn default_scenario(periods: usize) -> String {
    let text = include_str!("../../sims/default.toml");
    text.replace("periods = 8", &format!("periods = {periods}"))
}

/// A folder in which programs run, so that file names need no path.
pub struct Folder(TempDir);

impl Folder {
    pub fn empty() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    pub fn is_empty(&self) -> bool {
        std::fs::read_dir(self.0.path()).unwrap().next().is_none()
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Writes a file, and creates its folder if necessary.
    pub fn write(&self, name: &str, text: impl AsRef<[u8]>) {
        let path = self.path(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    }

    pub fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    pub fn json(&self, name: &str) -> Value {
        serde_json::from_str(&self.read(name)).unwrap()
    }

    /// Reads a result for users; `docs/formats.md` must describe every key of it.
    pub fn result(&self, name: &str) -> Value {
        let result = self.json(name);
        described::assert_described(name, &result);
        result
    }

    pub fn armid(&self, words: &str) -> Said {
        Said::by(self.command(env!("CARGO_BIN_EXE_armid"), words))
    }

    pub fn montecarlo(&self, words: &str) -> Said {
        Said::by(self.montecarlo_command(words))
    }

    /// A command that is not started yet, for tests that act while it runs.
    pub fn montecarlo_command(&self, words: &str) -> Command {
        self.command(env!("CARGO_BIN_EXE_montecarlo"), words)
    }

    fn command(&self, program: &str, words: &str) -> Command {
        let mut command = Command::new(program);
        command.current_dir(self.0.path()).args(words.split_whitespace());
        command
    }
}

/// Exit code and output of a program.
pub struct Said {
    command: String,
    code: Option<i32>,
    stdout: String,
    pub stderr: String,
}

impl Said {
    fn by(mut command: Command) -> Self {
        let Output { status, stdout, stderr } = command.output().unwrap();
        let [stdout, stderr] =
            [stdout, stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
        Self { command: format!("{command:?}"), code: status.code(), stdout, stderr }
    }

    /// Asserts the exit code and that the terminal shows all of `words`; returns the text of the terminal.
    pub fn says(&self, code: i32, words: &[&str]) -> String {
        let text = format!("{}{}", self.stdout, self.stderr);
        assert_eq!(self.code, Some(code), "{}: {text}", self.command);
        self.contains(&text, words);
        text
    }

    /// The same for stderr alone, where errors and notes belong.
    pub fn complains(&self, code: i32, words: &[&str]) {
        self.says(code, &[]);
        self.contains(&self.stderr, words);
    }

    fn contains(&self, text: &str, words: &[&str]) {
        for word in words {
            assert!(text.contains(word), "{}: \"{word}\" is not in: {text}", self.command);
        }
    }
}
