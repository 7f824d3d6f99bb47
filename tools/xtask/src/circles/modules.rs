//! The modules of one crate, and which file a path leads to: through modules, imports and re-exports to the definition.

use std::collections::{BTreeMap, BTreeSet};

use super::source::{Place, Scope, Use};

/// The lines on which a file imports from another: (importing file, imported file) → lines.
pub(super) type Imports = BTreeMap<(String, String), BTreeSet<usize>>;

/// A crate from its root file down.
#[derive(Debug, Default)]
pub(super) struct Modules<'a> {
    all: Vec<Module<'a>>,
}

#[derive(Debug)]
struct Module<'a> {
    file: &'a str,
    scope: &'a Scope,
    parent: Option<usize>,
    children: BTreeMap<&'a str, usize>,
}

/// Where a path leads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Target {
    Module(usize),
    /// Something that is defined in this module.
    Item(usize),
}

impl Target {
    fn module(self) -> usize {
        match self {
            Self::Module(module) | Self::Item(module) => module,
        }
    }
}

impl<'a> Modules<'a> {
    /// The crate whose root file is `root`, out of files that were read. Modules without a file (made by a build script,
    /// or for another platform) are left out.
    pub(super) fn of(root: &'a str, sources: &'a BTreeMap<String, Scope>) -> Self {
        let mut modules = Self::default();
        if let Some((file, scope)) = sources.get_key_value(root) {
            let folder = file.rsplit_once('/').map_or("", |(folder, _)| folder).to_owned();
            modules.add(file, scope, None, &folder, sources);
        }
        modules
    }

    /// Adds a module and all below it. `folder` is where the files of its children lie.
    fn add(
        &mut self,
        file: &'a str,
        scope: &'a Scope,
        parent: Option<usize>,
        folder: &str,
        sources: &'a BTreeMap<String, Scope>,
    ) -> usize {
        let this = self.all.len();
        self.all.push(Module { file, scope, parent, children: BTreeMap::new() });
        for (name, inline) in &scope.inline {
            let child = self.add(file, inline, Some(this), &join(folder, name), sources);
            self.all[this].children.insert(name, child);
        }
        for (name, path) in &scope.declared {
            let beside = file.rsplit_once('/').map_or("", |(folder, _)| folder);
            let candidates = match path {
                Some(path) => vec![join(beside, path)],
                None => vec![join(folder, &format!("{name}.rs")), join(folder, &format!("{name}/mod.rs"))],
            };
            let Some((found, below)) = candidates.iter().find_map(|path| sources.get_key_value(path)) else {
                continue;
            };
            // A file that declares itself would never end.
            if self.ancestors(this).any(|module| self.all[module].file == found) {
                continue;
            }
            let inside = match found.strip_suffix("/mod.rs") {
                Some(folder) => folder.to_owned(),
                None => found.strip_suffix(".rs").unwrap_or(found).to_owned(),
            };
            let child = self.add(found, below, Some(this), &inside, sources);
            self.all[this].children.insert(name, child);
        }
        this
    }

    /// Every import between two files of this crate.
    pub(super) fn imports(&self) -> Imports {
        let mut imports = Imports::new();
        for (this, module) in self.all.iter().enumerate() {
            let mut add = |target: usize, line: usize| {
                let file = self.all[target].file;
                if file != module.file {
                    imports.entry((module.file.to_owned(), file.to_owned())).or_default().insert(line);
                }
            };
            for import in &module.scope.uses {
                for target in self.imported(this, import) {
                    add(target, import.from.line);
                }
            }
            for path in &module.scope.paths {
                if let Some(target) = self.follow(this, path, &mut BTreeSet::new()) {
                    add(target.module(), path.line);
                }
            }
        }
        imports
    }

    /// The modules that one `use` of module `this` imports from.
    fn imported(&self, this: usize, import: &Use) -> Vec<usize> {
        let Some(target) = self.follow(this, &import.from, &mut BTreeSet::new()) else {
            return Vec::new();
        };
        let words = &self.all[this].scope.words;
        let below = self.ancestors(target.module()).any(|module| module == this);
        // A parent that hands on what is its children's imports it only where it uses it.
        let handed_on = import.public && below;
        match (&import.name, target) {
            (Some(name), Target::Item(module)) => {
                if handed_on && !words.contains_key(name) {
                    Vec::new()
                } else {
                    vec![module]
                }
            }
            // Paths through a module count for themselves, by what they lead to.
            (Some(name), Target::Module(module)) => {
                let through = self.all[this].scope.paths.iter().any(|path| path.segments[0] == *name);
                if handed_on || through { Vec::new() } else { vec![module] }
            }
            (None, target) => {
                let module = target.module();
                let used = words.keys().filter_map(|word| self.look_up(module, word, &mut BTreeSet::new()));
                let used: BTreeSet<usize> = used.map(Target::module).collect();
                if used.is_empty() && !handed_on { vec![module] } else { used.into_iter().collect() }
            }
        }
    }

    /// Where `path` leads, seen from module `from`; `None` where it leaves the crate.
    fn follow(&self, from: usize, path: &Place, seen: &mut BTreeSet<(usize, String)>) -> Option<Target> {
        let mut at = from;
        // `crate`, `super` and `self` lead into this crate for sure; a plain name may be another crate's.
        let mut sure = false;
        for segment in &path.segments {
            match segment.as_str() {
                "crate" => at = self.ancestors(from).last()?,
                "super" => at = self.all[at].parent?,
                "self" => {}
                name => match self.look_up(at, name, seen) {
                    Some(Target::Module(module)) => at = module,
                    Some(item) => return Some(item),
                    // A variant of a macro, a name that a build script made: the module that was named has it.
                    None => return sure.then_some(Target::Item(at)),
                },
            }
            sure = true;
        }
        Some(Target::Module(at))
    }

    /// What `name` is in module `at`: defined there, or imported into it. `seen` ends re-exports that go round.
    fn look_up(&self, at: usize, name: &str, seen: &mut BTreeSet<(usize, String)>) -> Option<Target> {
        let module = &self.all[at];
        if let Some(&child) = module.children.get(name) {
            return Some(Target::Module(child));
        }
        if module.scope.items.contains(name) {
            return Some(Target::Item(at));
        }
        if !seen.insert((at, name.to_owned())) {
            return None;
        }
        let named = module.scope.uses.iter().filter(|import| import.name.as_deref() == Some(name));
        if let Some(target) = named.into_iter().find_map(|import| self.follow(at, &import.from, seen)) {
            return Some(target);
        }
        let globs = module.scope.uses.iter().filter(|import| import.name.is_none());
        globs.into_iter().find_map(|import| match self.follow(at, &import.from, seen)? {
            Target::Module(inside) if inside != at => self.look_up(inside, name, seen),
            _ => None,
        })
    }

    /// A module and those it lies in, up to the root.
    fn ancestors(&self, module: usize) -> impl Iterator<Item = usize> {
        std::iter::successors(Some(module), |&module| self.all[module].parent)
    }
}

/// `folder/path`, with `..` taken out.
fn join(folder: &str, path: &str) -> String {
    let mut parts: Vec<&str> = folder.split('/').filter(|part| !part.is_empty()).collect();
    for part in path.split('/') {
        match part {
            "." | "" => {}
            ".." => _ = parts.pop(),
            part => parts.push(part),
        }
    }
    parts.join("/")
}
