//! Published checkpoints: their names at the Hugging Face hub, and their licences (`spec/da3.md` section 1).

/// A checkpoint that its authors publish.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Published {
    /// The repository, such as `depth-anything/DA3-SMALL`.
    pub repository: &'static str,
    /// What its configuration calls the network.
    pub network: &'static str,
    /// Its licence, as published.
    pub licence: &'static str,
}

const FREE: &str = "Apache-2.0";
const NON_COMMERCIAL: &str = "CC BY-NC 4.0 (no commercial use)";

const fn published(repository: &'static str, network: &'static str, licence: &'static str) -> Published {
    Published { repository, network, licence }
}

/// All of them, smaller ones first.
pub const PUBLISHED: [Published; 10] = [
    published("depth-anything/DA3-SMALL", "da3-small", FREE),
    published("depth-anything/DA3-BASE", "da3-base", FREE),
    published("depth-anything/DA3-LARGE", "da3-large", NON_COMMERCIAL),
    published("depth-anything/DA3-LARGE-1.1", "da3-large-1.1", NON_COMMERCIAL),
    published("depth-anything/DA3-GIANT", "da3-giant", NON_COMMERCIAL),
    published("depth-anything/DA3-GIANT-1.1", "da3-giant-1.1", NON_COMMERCIAL),
    published("depth-anything/DA3MONO-LARGE", "da3mono-large", FREE),
    published("depth-anything/DA3METRIC-LARGE", "da3metric-large", FREE),
    published("depth-anything/DA3NESTED-GIANT-LARGE", "da3nested-giant-large", NON_COMMERCIAL),
    published("depth-anything/DA3NESTED-GIANT-LARGE-1.1", "da3nested-giant-large-1.1", NON_COMMERCIAL),
];

/// The licence of the weights of a network of this name, where it is a published one.
#[must_use]
pub fn licence(network: &str) -> Option<&'static str> {
    PUBLISHED.iter().find(|known| known.network.eq_ignore_ascii_case(network)).map(|known| known.licence)
}

/// The repository that a name stands for: itself, or that of a published checkpoint whose last part or network it is.
pub(crate) fn repository(name: &str) -> Option<String> {
    let last =
        |known: &Published| known.repository.rsplit('/').next().is_some_and(|last| last.eq_ignore_ascii_case(name));
    if let Some(known) = PUBLISHED.iter().find(|known| last(known) || known.network.eq_ignore_ascii_case(name)) {
        return Some(known.repository.to_owned());
    }
    let (owner, rest) = name.split_once('/')?;
    let plain = |part: &str| {
        !part.is_empty()
            && !part.starts_with('.')
            && part.chars().all(|c| c.is_ascii_alphanumeric() || "-_.".contains(c))
    };
    (plain(owner) && plain(rest)).then(|| name.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_lead_to_repositories() {
        for name in ["depth-anything/DA3-SMALL", "DA3-SMALL", "da3-small", "Da3-Small"] {
            assert_eq!(repository(name).as_deref(), Some("depth-anything/DA3-SMALL"), "{name}");
        }
        assert_eq!(repository("somebody/weights.v2").as_deref(), Some("somebody/weights.v2"));
        for no in ["nothing", "a/b/c", "../x", "./x", "x/", "/x", "a/..", "C:\\x/y", "a b/c"] {
            assert_eq!(repository(no), None, "{no}");
        }
    }

    #[test]
    fn licences_are_those_of_networks() {
        assert_eq!(licence("da3-base"), Some("Apache-2.0"));
        assert!(licence("DA3-GIANT-1.1").is_some_and(|licence| licence.contains("BY-NC")));
        assert_eq!(licence("mine"), None);
    }
}
