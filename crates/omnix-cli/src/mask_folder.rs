//! `--masks` as it is written: a folder, and what its masks say.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

/// What the masks of a folder say of a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Says {
    /// Black: leave it out.
    Ignore,
    /// Not black: it stands still.
    Still,
    /// Not black: it moves.
    Moving,
}

const NAMES: [(&str, Says); 3] = [("ignore", Says::Ignore), ("still", Says::Still), ("moving", Says::Moving)];

impl Says {
    pub(crate) fn name(self) -> &'static str {
        NAMES.iter().find(|(_, says)| *says == self).map_or("", |(name, _)| name)
    }
}

/// `--masks`, once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct MaskFolder {
    pub(crate) says: Says,
    pub(crate) path: PathBuf,
}

impl FromStr for MaskFolder {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let named = text.split_once('=').and_then(|(kind, path)| {
            NAMES.iter().find(|(name, _)| *name == kind).map(|(_, says)| Self { says: *says, path: path.into() })
        });
        let found = named.unwrap_or_else(|| Self { says: Says::Ignore, path: text.into() });
        if found.path.as_os_str().is_empty() {
            return Err("a folder of masks, such as masks, ignore=masks, still=walls or moving=people".to_owned());
        }
        Ok(found)
    }
}

impl fmt::Display for MaskFolder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}={}", self.says.name(), self.path.display())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_may_say_what_its_masks_say() {
        let read = |text: &str| text.parse::<MaskFolder>().map(|found| (found.says, found.path));
        assert_eq!(read("a/b"), Ok((Says::Ignore, "a/b".into())));
        assert_eq!(read("still=a=b"), Ok((Says::Still, "a=b".into())));
        assert_eq!(read("moving=x"), Ok((Says::Moving, "x".into())));
        // A folder may have such a name.
        assert_eq!(read("odd=name"), Ok((Says::Ignore, "odd=name".into())));
        assert!(read("").is_err() && read("ignore=").is_err());
    }
}
