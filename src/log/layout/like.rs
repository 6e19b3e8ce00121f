//! A layout that is another one but for what it says itself.

use std::path::{Path, PathBuf};

use toml::{Table, Value};

use super::{built_in, is_file};
use crate::log::error::{LayoutFault, LogError};

/// Layouts that may be like one another before it is a circle.
const LIMIT: usize = 8;
/// Tables of which single keys are replaced; any other key is replaced as a whole.
const BY_KEY: [&str; 2] = ["units", "columns"];

/// What `text` says over what the layout says that it is `like`, and the files of the latter; `None` where it is like none, or is no
/// TOML. `source` is what the text was read from.
pub(super) fn overlaid(
    text: &str,
    source: &str,
) -> Result<Option<(Table, Vec<PathBuf>)>, LayoutFault> {
    let mut files = Vec::new();
    let table = overlaid_within(text, source, LIMIT, &mut files)?;
    Ok(table.map(|table| (table, files)))
}

fn overlaid_within(
    text: &str,
    source: &str,
    limit: usize,
    files: &mut Vec<PathBuf>,
) -> Result<Option<Table>, LayoutFault> {
    let Ok(mut own) = text.parse::<Table>() else { return Ok(None) };
    let Some(like) = own.remove(KEY) else { return Ok(None) };
    let Value::String(like) = like else { return Err(LayoutFault::Toml(LIKE.to_owned())) };
    let limit = limit
        .checked_sub(1)
        .ok_or_else(|| LayoutFault::LikeItself { like: like.clone(), limit: LIMIT })?;
    let fault = |fault| LayoutFault::Like { like: like.clone(), fault: Box::new(fault) };
    let (below, name) = match built_in(&like) {
        Some(text) => (text.to_owned(), like.clone()),
        None if !is_file(&like) => {
            return Err(fault(LogError::UnknownLayout { name: like.clone() }));
        }
        None => {
            let path = Path::new(source).parent().unwrap_or(Path::new("")).join(&like);
            let name = path.display().to_string();
            let text = std::fs::read_to_string(&path).map_err(|e| {
                fault(LogError::Layout { file: name.clone(), fault: LayoutFault::Read(e) })
            })?;
            files.push(path);
            (text, name)
        }
    };
    let in_file = |error| fault(LogError::Layout { file: name.clone(), fault: error });
    let mut table = match overlaid_within(&below, &name, limit, files) {
        Ok(Some(table)) => table,
        Ok(None) => {
            below.parse().map_err(|e: toml::de::Error| in_file(LayoutFault::Toml(e.to_string())))?
        }
        Err(circle @ LayoutFault::LikeItself { .. }) => return Err(circle),
        Err(error) => return Err(in_file(error)),
    };
    for (key, value) in own {
        match (table.get_mut(&key), value) {
            (Some(Value::Table(there)), Value::Table(own)) if BY_KEY.contains(&&*key) => {
                there.extend(own);
            }
            (_, value) => {
                table.insert(key, value);
            }
        }
    }
    Ok(Some(table))
}

/// The key that names the other layout.
const KEY: &str = "like";
const LIKE: &str = "like is the name of a layout or of a .toml file, in quotes";

#[cfg(test)]
mod tests {
    use crate::log::Layout;
    use crate::log::layout::block::Block;

    #[test]
    fn what_it_does_not_say_is_as_in_the_other() {
        let text = "name = \"turned\"\nlike = \"armid\"\n[joints]\ntorque_reversed = [2]\n[columns]\ntorque = \"tau_{0}\"\n";
        let layout = Layout::from_toml(text, "turned.toml").unwrap();
        let armid = Layout::default();
        assert_eq!(layout.name, "turned");
        assert_eq!(layout.columns(Block::Torque).unwrap().name(1).unwrap(), "tau_1");
        assert_eq!(layout.columns(Block::Q), armid.columns(Block::Q));
        assert!(layout.counting(6).torque()[1].is_reversed);
    }

    #[test]
    fn files_are_looked_for_beside_the_layout() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, text).unwrap();
            path.to_str().unwrap().to_owned()
        };
        write("a.toml", "name = \"a\"\nlike = \"armid\"\n[joints]\nmotion_reversed = [1, 2]\n");
        let b =
            write("b.toml", "name = \"b\"\nlike = \"a.toml\"\n[joints]\nmotion_reversed = [3]\n");
        let layout = Layout::load(&b).unwrap();
        let reversed: Vec<bool> =
            layout.counting(3).motion().iter().map(|place| place.is_reversed).collect();
        assert_eq!(reversed, [false, false, true]);
        assert_eq!(layout.files().len(), 2, "{:?}", layout.files());
        let circle = write("c.toml", "name = \"c\"\nlike = \"c.toml\"\n");
        let message = Layout::load(&circle).unwrap_err().to_string();
        assert!(message.contains("c.toml") && message.contains("leads back"), "{message}");
        for (like, part) in
            [("\"ur10\"", "ur10e_innopolis"), ("\"no.toml\"", "no.toml"), ("1", "in quotes")]
        {
            let path = write("d.toml", &format!("name = \"d\"\nlike = {like}\n"));
            let message = Layout::load(&path).unwrap_err().to_string();
            assert!(message.contains(part), "{like}: {message}");
        }
        let bad = write("e.toml", "name = \"e\"\nlike = \"armid\"\n[joints]\nreversed = [1]\n");
        let message = Layout::load(&bad).unwrap_err().to_string();
        assert!(message.contains("reversed"), "{message}");
    }
}
