//! A configuration from its file: a key or choice that is not known is refused with the nearest one that is.

use std::io;
use std::path::Path;

use omnix_model::NetworkConfig;
use omnix_tensors::{TensorError, read_text};
use serde_json::Value;

use crate::TrainError;
use crate::config::{Config, NetworkSource, Recipe, Start};

/// Bytes of a configuration at most.
const MAX_TEXT: u64 = 1 << 20;

/// Reads a configuration and the network that it names.
///
/// # Errors
/// A file that is not there, is no TOML, has unknown keys or keys that contradict each other; a network that cannot be.
pub fn read_config(path: &Path) -> Result<Recipe, TrainError> {
    let bad = |reason: String| TrainError::Config { path: path.to_owned(), reason };
    let text = read_text(path, MAX_TEXT).map_err(|e| match e {
        TensorError::Io { source, .. } if source.kind() == io::ErrorKind::InvalidData => bad(source.to_string()),
        other => other.into(),
    })?;
    let mut config: Config = toml::from_str(&text).map_err(|e| bad(explained(&e, &text)))?;
    let folder = path.parent().unwrap_or(Path::new(""));
    if let Start::Checkpoint { path } | Start::DepthAnything3 { path } = &mut config.start {
        *path = folder.join(&path);
    }
    let held_out = config.validation.iter_mut().flat_map(|validation| &mut validation.data);
    for data in config.data.iter_mut().chain(held_out) {
        let paths = [&mut data.path, &mut data.recipe, &mut data.photos];
        paths.into_iter().flatten().for_each(|path| *path = folder.join(&path));
    }
    config.check()?;
    let network_json = match &mut config.network {
        NetworkSource::Inline(fields) => Value::Object(fields.clone()),
        NetworkSource::Path(file) => {
            *file = folder.join(&file);
            let bad = |reason: String| TrainError::Config { path: file.clone(), reason };
            let text = read_text(file, MAX_TEXT)?;
            serde_json::from_str(&text).map_err(|e| bad(format!("not the JSON of a network ({e})")))?
        }
    };
    let network = NetworkConfig::from_json(&network_json)?;
    if config.sample.scenes > 1 && network.trajectory.is_some() {
        let cure = "samples of several scenes teach no motion: leave [network.trajectory] out, or take one scene";
        return Err(TrainError::contradiction("sample.scenes", cure));
    }
    Ok(Recipe { config, network_json, network })
}

/// The parser's message on one line, with the line's number and, for an unknown word, the nearest known one.
fn explained(error: &toml::de::Error, text: &str) -> String {
    let message = error.message().replace('\n', " ");
    let line = error.span().map(|span| text.get(..span.start).map_or(1, |before| before.matches('\n').count() + 1));
    let at = line.map_or_else(String::new, |line| format!("line {line}: "));
    let hint = nearest(&message).map_or_else(String::new, |word| format!("; did you mean `{word}`?"));
    format!("{at}{message}{hint}")
}

/// Of a message "unknown field `a`, expected one of `b`, `c`", as serde writes it, the expected word most like the unknown one.
fn nearest(message: &str) -> Option<&str> {
    if !message.contains("unknown") {
        return None;
    }
    let mut words = message.split('`').skip(1).step_by(2);
    let unknown = words.next()?;
    let distance = |word: &&str| strsim::damerau_levenshtein(unknown, word);
    let (distance, word) = words.map(|word| (distance(&word), word)).min_by_key(|(distance, _)| *distance)?;
    // Farther away it is no slip of the pen.
    (distance <= 1 + unknown.chars().count() / 3).then_some(word)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Made;

    const NETWORK: &str = include_str!("../../../assets/weights/nano/config.json");
    const SMALL: &str = r#"
steps = 20
network = "nano.json"
sample = { images = 4, size = [140, 84] }
[[data]]
made = "shapes"
"#;

    fn read(text: &str) -> Result<Recipe, TrainError> {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("nano.json"), NETWORK).unwrap();
        let path = dir.path().join("config.toml");
        std::fs::write(&path, text).unwrap();
        read_config(&path)
    }

    fn refused(text: &str) -> String {
        read(text).unwrap_err().to_string()
    }

    #[test]
    fn defaults_are_those_of_the_release() {
        let recipe = read(SMALL).unwrap();
        let config = &recipe.config;
        assert_eq!(config.group.len(), 5);
        assert_eq!((config.optimiser.betas, config.optimiser.decay, config.optimiser.clip), ([0.9, 0.95], 0.05, 1.0));
        assert_eq!((config.data[0].made, config.start.clone()), (Some(Made::Shapes), Start::Seed));
        assert!(!config.averaged() && !config.keeps_best());
        assert_eq!(recipe.network.backbone.width, 192);
        let again: Config = serde_json::from_value(config.settings()).unwrap();
        assert_eq!(again, *config);
    }

    #[test]
    fn a_network_may_stand_in_the_file() {
        let json: serde_json::Map<String, Value> = serde_json::from_str(NETWORK).unwrap();
        let text = SMALL.replace("network = \"nano.json\"\n", "");
        let inline = format!("{text}[network]\n{}", toml::to_string(&json).unwrap().replace("\n[", "\n[network."));
        let (a, b) = (read(&inline).unwrap(), read(SMALL).unwrap());
        assert_eq!(a.network, b.network);
        let text = refused(&inline.replace("position_grid", "position_gird"));
        assert!(text.contains("position_gird"), "{text}");
    }

    #[test]
    fn unknown_words_are_refused_with_the_nearest() {
        let text = refused(&format!("sede = 3\n{SMALL}"));
        assert!(text.contains("line 1") && text.contains("did you mean `seed`?"), "{text}");
        let text = refused(&format!("{SMALL}[optimiser]\nacumulate = 2\n"));
        assert!(text.contains("did you mean `accumulate`?"), "{text}");
        let text = refused(&SMALL.replace("shapes", "shape"));
        assert!(text.contains("did you mean `shapes`?"), "{text}");
        let text = refused(&format!("utterly_different = 3\n{SMALL}"));
        assert!(!text.contains("did you mean") && text.contains("`steps`"), "{text}");
    }

    #[test]
    fn contradictions_are_named() {
        for (more, named) in [
            ("[schedule]\nwarm_up = 20\n", "schedule.warm_up"),
            ("[checkpoint]\nbest = true\n", "checkpoint.best"),
            ("[validation]\nevery = 0\nsamples = 1\n", "validation.every"),
            ("[[group]]\nname = \"\"\n", "rate of group"),
            ("[[group]]\nname = \"\"\nrate = 1.0\nfrozen = true\n", "rate of group"),
            ("[[group]]\nname = \"a\"\nrate = 1.0\n[[group]]\nname = \"ab\"\nrate = 1.0\n", "move it up"),
            ("[[group]]\nname = \"\"\nrate = nan\n", "rate of group"),
            ("weight = 0.0\n", "data.weight"),
            ("path = \"a\"\n", "either made or path"),
            ("step = 2\n", "they go with path"),
            ("photos = \"a\"\n", "they go with made"),
            ("[[data]]\npath = \"a\"\nset = \"eu\"\n", "`eu` is not one of ue,"),
            ("[[data]]\npath = \"a\"\nshares = [0.5, 0.1, 0.1]\n", "data.shares"),
            ("[[data]]\npath = \"a\"\n[validation]\nevery = 1\nsamples = 1\n", "validation.data"),
            ("[loss]\nlambda1 = -1.0\n", "loss.lambda1 is -1"),
            ("[optimiser]\naverage = 1.0\n", "optimiser.average"),
            ("[optimiser]\naccumulate = 0\n", "optimiser.accumulate"),
        ] {
            let text = refused(&format!("{SMALL}{more}"));
            assert!(text.contains(named), "{more}: {text}");
        }
        assert!(refused(&SMALL.replace("images = 4", "images = 4, scenes = 3")).contains("shared equally"));
        let still = refused(&SMALL.replace("images = 4", "images = 4, scenes = 2"));
        assert!(still.contains("sample.scenes") && still.contains("trajectory"), "{still}");
        assert!(refused(&format!("layer_scale = 0\n{SMALL}")).contains("layer_scale"));
        assert!(refused(&SMALL.replace("84", "85")).contains("multiples of 14"));
        assert!(refused(&SMALL.replace("[[data]]\nmade = \"shapes\"\n", "")).contains("no data"));
        assert!(refused(&SMALL.replace("steps = 20", "steps = 0")).contains("steps"));
        assert!(refused(&format!("memory_budget = \"4 apples\"\n{SMALL}")).contains("memory_budget"));
        assert!(refused(&SMALL.replace("nano.json", "other.json")).contains("other.json"));
    }

    #[test]
    fn paths_are_relative_to_the_file() {
        let text = format!("{SMALL}[[data]]\npath = \"scenes\"\n")
            .replace("steps", "start = { from = \"checkpoint\", path = \"c\" }\nsteps");
        let config = read(&text).unwrap().config;
        let Start::Checkpoint { path } = &config.start else { panic!("{config:?}") };
        let folder = path.parent().unwrap();
        assert!(folder.is_absolute() && config.data[1].path == Some(folder.join("scenes")));
    }

    #[test]
    fn recipes_of_the_repository_can_be_read() {
        let recipes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../recipes");
        let files = std::fs::read_dir(recipes).unwrap().flatten().map(|entry| entry.path());
        let tables: Vec<_> = files.filter(|path| path.extension().is_some_and(|end| end == "toml")).collect();
        assert!(!tables.is_empty());
        for path in tables {
            let recipe = read_config(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
            assert!(recipe.network.trajectory.is_some());
        }
    }

    #[test]
    fn a_budget_has_a_unit() {
        let bytes = |text: &str| read(&format!("memory_budget = \"{text}\"\n{SMALL}")).unwrap().config.budget_bytes();
        assert_eq!(bytes("4GiB").unwrap(), Some(4 << 30));
        assert_eq!(bytes("1.5 gib").unwrap(), Some(3 << 29));
        assert_eq!(bytes("300MiB").unwrap(), Some(300 << 20));
    }
}
