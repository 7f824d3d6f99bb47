//! What one Rust file imports and defines, read from its tokens.
//!
//! Tokens and not a syntax tree: what stands inside of macros (`assert!`, `proptest!`, attributes of clap) counts as well.
//! Items under `#[cfg(test)]` are left out, because a unit test may look at whatever it likes.

use std::collections::{BTreeMap, BTreeSet};
use std::str::FromStr as _;

use proc_macro2::{Delimiter, Group, LexError, TokenStream, TokenTree};

/// A module as its own text says it: a file, or a `mod name { .. }` inside of one.
#[derive(Debug, Default)]
pub(super) struct Scope {
    /// Modules with a file of their own, and the file where `#[path]` names one.
    pub(super) declared: Vec<(String, Option<String>)>,
    /// Modules written out in this one.
    pub(super) inline: Vec<(String, Scope)>,
    /// Every name that a `use` binds.
    pub(super) uses: Vec<Use>,
    /// Paths of two segments and more outside of `use`.
    pub(super) paths: Vec<Place>,
    /// Names of the items defined here.
    pub(super) items: BTreeSet<String>,
    /// Every identifier outside of `use`, and the line where it is first.
    pub(super) words: BTreeMap<String, usize>,
}

/// A path in the text.
#[derive(Debug, Clone)]
pub(super) struct Place {
    /// Its segments, `crate`, `super` and `self` among them.
    pub(super) segments: Vec<String>,
    /// Line of the text, from 1.
    pub(super) line: usize,
}

/// One name of a `use`, or one glob.
#[derive(Debug, Clone)]
pub(super) struct Use {
    /// What is imported.
    pub(super) from: Place,
    /// The name it has here; `None` for a glob.
    pub(super) name: Option<String>,
    /// Whether it has a visibility, which makes it a re-export.
    pub(super) public: bool,
}

impl Scope {
    /// Reads the text of a file.
    ///
    /// # Errors
    /// [`LexError`] where the text is no Rust.
    pub(super) fn read(text: &str) -> Result<Self, LexError> {
        let mut scope = Self::default();
        scope.walk(TokenStream::from_str(text)?, true);
        Ok(scope)
    }

    /// Takes in a sequence of tokens; `top` where items of the module itself stand.
    fn walk(&mut self, tokens: TokenStream, top: bool) {
        let tokens: Vec<TokenTree> = tokens.into_iter().collect();
        let mut path = None;
        let mut at = 0;
        while at < tokens.len() {
            if let Some((attribute, next)) = attribute(&tokens, at) {
                if is_test(attribute) {
                    at = after_item(&tokens, next);
                } else {
                    path = path_attribute(attribute).or(path);
                    self.walk(attribute.stream(), false);
                    at = next;
                }
                continue;
            }
            at = match &tokens[at] {
                // The brackets of `pub(in path)` import nothing.
                TokenTree::Group(_) if at > 0 && identifier(&tokens[at - 1]).as_deref() == Some("pub") => at + 1,
                TokenTree::Group(group) => {
                    self.walk(group.stream(), false);
                    at + 1
                }
                TokenTree::Ident(_) => self.word(&tokens, at, top, &mut path),
                TokenTree::Punct(_) | TokenTree::Literal(_) => at + 1,
            };
        }
    }

    /// Takes in what begins with the identifier at `at`; returns where to go on.
    fn word(&mut self, tokens: &[TokenTree], at: usize, top: bool, path: &mut Option<String>) -> usize {
        let name = |at: usize| tokens.get(at).and_then(identifier);
        let Some(word) = name(at) else {
            return at + 1;
        };
        match (word.as_str(), name(at + 1)) {
            ("mod", Some(module)) => {
                let path = path.take();
                if let Some(TokenTree::Group(body)) = tokens.get(at + 2) {
                    let mut scope = Self::default();
                    scope.walk(body.stream(), true);
                    self.inline.push((module, scope));
                } else {
                    self.declared.push((module, path));
                }
                return at + 3;
            }
            // `use<'a>` in a type captures lifetimes.
            ("use", _) if !is_punct(tokens.get(at + 1), '<') => {
                let end = (at..tokens.len()).find(|&i| is_punct(tokens.get(i), ';')).unwrap_or(tokens.len());
                let public = is_public(&tokens[..at]);
                for (from, name) in leaves(&tokens[at + 1..end], &[]) {
                    self.uses.push(Use { from, name, public });
                }
                return end + 1;
            }
            ("struct" | "enum" | "union" | "trait" | "type" | "fn" | "const" | "static", Some(item)) if top => {
                self.items.insert(item);
            }
            ("macro_rules", _) if top => self.items.extend(name(at + 2)),
            _ => {}
        }
        let line = tokens[at].span().start().line;
        self.words.entry(word.clone()).or_insert(line);
        let mut segments = vec![word];
        let mut next = at + 1;
        while is_colons(tokens, next)
            && let Some(segment) = name(next + 2)
        {
            self.words.entry(segment.clone()).or_insert(line);
            segments.push(segment);
            next += 3;
        }
        // A path after `::` or `.` is the rest of one that began with a type or a value, or another crate's.
        let begins = at == 0 || !(is_punct(tokens.get(at - 1), '.') || (at > 1 && is_colons(tokens, at - 2)));
        if segments.len() > 1 && begins {
            self.paths.push(Place { segments, line });
        }
        next
    }
}

/// The brackets of the attribute that begins at `at`, and the index behind them.
fn attribute(tokens: &[TokenTree], at: usize) -> Option<(&Group, usize)> {
    if !is_punct(tokens.get(at), '#') {
        return None;
    }
    let inner = usize::from(is_punct(tokens.get(at + 1), '!'));
    match tokens.get(at + 1 + inner) {
        Some(TokenTree::Group(group)) if group.delimiter() == Delimiter::Bracket => Some((group, at + 2 + inner)),
        _ => None,
    }
}

/// `cfg(test)`, alone or inside of `all(..)`.
fn is_test(attribute: &Group) -> bool {
    let mut tokens = attribute.stream().into_iter();
    let cfg = tokens.next().as_ref().and_then(identifier).as_deref() == Some("cfg");
    let condition = tokens.next().map(|condition| condition.to_string()).unwrap_or_default();
    let words: Vec<&str> = condition.split(|c: char| !c.is_alphanumeric() && c != '_').collect();
    cfg && words.contains(&"test") && !words.contains(&"not") && !words.contains(&"any")
}

/// The file that `path = "file"` names.
fn path_attribute(attribute: &Group) -> Option<String> {
    let tokens: Vec<TokenTree> = attribute.stream().into_iter().collect();
    match &tokens[..] {
        [TokenTree::Ident(name), _, TokenTree::Literal(file)] if name == "path" => {
            Some(file.to_string().trim_matches('"').to_owned())
        }
        _ => None,
    }
}

/// The index behind the item that begins at `at`: behind its braces, or its semicolon.
fn after_item(tokens: &[TokenTree], at: usize) -> usize {
    let ends = |token: &TokenTree| match token {
        TokenTree::Group(group) => group.delimiter() == Delimiter::Brace,
        other => is_punct(Some(other), ';'),
    };
    // A `use` may have braces before its semicolon.
    let is_use = tokens[at..].iter().take(3).any(|token| identifier(token).as_deref() == Some("use"));
    let end = |token: &TokenTree| if is_use { is_punct(Some(token), ';') } else { ends(token) };
    tokens[at..].iter().position(end).map_or(tokens.len(), |offset| at + offset + 1)
}

/// Does what stands before an item end in `pub` or `pub(..)`?
fn is_public(before: &[TokenTree]) -> bool {
    let is_pub = |token: Option<&TokenTree>| token.and_then(identifier).as_deref() == Some("pub");
    match before.last() {
        Some(TokenTree::Group(group)) if group.delimiter() == Delimiter::Parenthesis => {
            is_pub(before.len().checked_sub(2).and_then(|at| before.get(at)))
        }
        last => is_pub(last),
    }
}

/// What the tree of a `use` binds: each path, and its name here (`None` for a glob).
fn leaves(tree: &[TokenTree], before: &[String]) -> Vec<(Place, Option<String>)> {
    let mut found = Vec::new();
    for branch in tree.split(|token| is_punct(Some(token), ',')) {
        let Some(first) = branch.first() else {
            continue;
        };
        // Another crate's, whatever modules there are here.
        if is_colons(branch, 0) {
            continue;
        }
        let line = first.span().start().line;
        let mut segments = before.to_vec();
        let mut rename = None;
        let mut glob = false;
        for (at, token) in branch.iter().enumerate() {
            match token {
                TokenTree::Ident(word) if word == "as" => {
                    rename = branch.get(at + 1).and_then(identifier);
                    break;
                }
                TokenTree::Ident(_) => segments.extend(identifier(token)),
                TokenTree::Punct(punct) if punct.as_char() == '*' => glob = true,
                TokenTree::Group(group) => {
                    let inside: Vec<TokenTree> = group.stream().into_iter().collect();
                    found.extend(leaves(&inside, &segments));
                    segments.clear();
                    break;
                }
                TokenTree::Punct(_) | TokenTree::Literal(_) => {}
            }
        }
        // `a::{self}` is `a`.
        if segments.len() > 1 && segments.last().is_some_and(|last| last == "self") {
            segments.pop();
        }
        if let Some(last) = segments.last().cloned() {
            let name = (!glob).then(|| rename.unwrap_or(last));
            found.push((Place { segments, line }, name));
        }
    }
    found
}

fn identifier(token: &TokenTree) -> Option<String> {
    match token {
        TokenTree::Ident(word) => Some(word.to_string().trim_start_matches("r#").to_owned()),
        _ => None,
    }
}

fn is_punct(token: Option<&TokenTree>, wanted: char) -> bool {
    matches!(token, Some(TokenTree::Punct(punct)) if punct.as_char() == wanted)
}

fn is_colons(tokens: &[TokenTree], at: usize) -> bool {
    is_punct(tokens.get(at), ':') && is_punct(tokens.get(at + 1), ':')
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Scope {
        Scope::read(text).unwrap()
    }

    #[test]
    fn a_use_gives_each_of_its_names() {
        let scope = read("use crate::a::{self, B as C, d::{E, *}};\npub(crate) use f::G; use ::h::I;");
        let uses: Vec<_> = scope
            .uses
            .iter()
            .map(|u| (u.from.segments.join("::"), u.name.as_deref().unwrap_or("*"), u.public))
            .collect();
        let expected = [
            ("crate::a", "a", false),
            ("crate::a::B", "C", false),
            ("crate::a::d::E", "E", false),
            ("crate::a::d", "*", false),
            ("f::G", "G", true),
        ];
        assert_eq!(uses, expected.map(|(path, name, public)| (path.to_owned(), name, public)));
        assert_eq!(scope.uses[4].from.line, 2);
    }

    #[test]
    fn paths_are_found_in_types_expressions_macros_and_attributes() {
        let text = "#[arg(parser = crate::a::b)] struct S(crate::c::T);\n\
                    fn f() -> super::d::U { assert!(g::h::<u8>(x.y::<W>())); Vec::<crate::e::V>::new() }\n\
                    impl<T: ::other::X> S {}  // crate::comment::no\n const N: &str = \"crate::text::no\";";
        let paths: Vec<String> = read(text).paths.iter().map(|path| path.segments.join("::")).collect();
        assert_eq!(paths, ["crate::a::b", "crate::c::T", "super::d::U", "g::h", "crate::e::V"]);
    }

    #[test]
    fn tests_inside_of_a_file_are_left_out() {
        let text = "#[cfg(test)] use crate::{a, b};\n#[cfg(test)] mod tests { use crate::c::D; }\n\
                    #[cfg(all(test, unix))] fn f() { crate::e::g() }\n#[cfg(not(test))] use crate::h;";
        let scope = read(text);
        assert_eq!(scope.uses.iter().map(|u| u.from.segments.join("::")).collect::<Vec<_>>(), ["crate::h"]);
        assert!(scope.inline.is_empty() && scope.paths.is_empty());
    }

    #[test]
    fn modules_and_items_of_the_file_itself() {
        let text = "#[path = \"../x/mod.rs\"] mod a; pub mod b; mod c { fn inner() {} }\n\
                    pub struct S { f: u8 } impl S { fn method() { const LOCAL: u8 = 1; } } macro_rules! m { () => {} }";
        let scope = read(text);
        assert_eq!(scope.declared, [("a".to_owned(), Some("../x/mod.rs".to_owned())), ("b".to_owned(), None)]);
        assert_eq!(scope.inline[0].0, "c");
        assert_eq!(scope.items.iter().collect::<Vec<_>>(), ["S", "m"]);
    }
}
