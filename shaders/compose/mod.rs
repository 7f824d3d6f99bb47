//! The WGSL preprocessor: turns one kernel source and a set of definitions into plain WGSL.
//!
//! Directives stand alone on a line; everything else is WGSL with `$` substitutions.
//!
//! ```text
//! #import name             the text of lib/name.wgsl, once per output
//! #if NAME / #if !NAME     keep the lines that follow when NAME is defined and not 0
//! #else / #endif
//! #for i in 0..$TM         repeat the body with $i = 0, 1, …; loops nest
//! #end
//! $NAME, ${NAME}           a definition or loop variable
//! ${i*4+1}                 integer arithmetic over them: + - * /, left to right within a precedence
//! ```
//!
//! Loops exist because software devices need register tiles: WGSL arrays with a loop index live in
//! memory there, named variables live in registers (see ARCHITECTURE.md, "A kernel").

use std::collections::{BTreeMap, BTreeSet};

/// Named integers: the variant's definitions, extended by loop variables while a loop runs.
pub(crate) type Defines = BTreeMap<String, i64>;

/// Composes `source` under `defines`; `load` returns the text of an imported module.
///
/// # Errors
/// A message with the line number of the first bad directive or substitution.
pub(crate) fn compose(
    source: &str,
    defines: &Defines,
    load: &dyn Fn(&str) -> Result<String, String>,
) -> Result<String, String> {
    let mut out = String::with_capacity(source.len() * 2);
    let lines: Vec<&str> = source.lines().collect();
    let mut composer = Composer { load, imported: BTreeSet::new() };
    composer.block(&lines, 0, &mut defines.clone(), &mut out)?;
    Ok(out)
}

struct Composer<'a> {
    load: &'a dyn Fn(&str) -> Result<String, String>,
    imported: BTreeSet<String>,
}

impl Composer<'_> {
    /// Composes `lines`; `first` is the index of `lines[0]` in its file, for messages.
    fn block(&mut self, lines: &[&str], first: usize, vars: &mut Defines, out: &mut String) -> Result<(), String> {
        let mut i = 0;
        while i < lines.len() {
            let line = lines[i];
            let at = |message: String| format!("line {}: {message}", first + i + 1);
            let Some(directive) = line.trim_start().strip_prefix('#') else {
                out.push_str(&substitute(line, vars).map_err(at)?);
                out.push('\n');
                i += 1;
                continue;
            };
            let (word, rest) = directive.split_once(' ').unwrap_or((directive, ""));
            match word {
                "import" => {
                    let name = rest.trim();
                    if self.imported.insert(name.to_owned()) {
                        let text = (self.load)(name).map_err(at)?;
                        let inner: Vec<&str> = text.lines().collect();
                        self.block(&inner, 0, vars, out).map_err(|e| at(format!("in {name}: {e}")))?;
                    }
                    i += 1;
                }
                "if" => {
                    let (branch, end) = matching(lines, i, "if", "endif").map_err(at)?;
                    let name = rest.trim();
                    let (negated, name) = name.strip_prefix('!').map_or((false, name), |n| (true, n));
                    let on = vars.get(name).is_some_and(|v| *v != 0) != negated;
                    let body = match (on, branch) {
                        (true, middle) => Some((i + 1, middle.unwrap_or(end))),
                        (false, Some(middle)) => Some((middle + 1, end)),
                        (false, None) => None,
                    };
                    if let Some((from, to)) = body {
                        self.block(&lines[from..to], first + from, vars, out)?;
                    }
                    i = end + 1;
                }
                "for" => {
                    let (_, end) = matching(lines, i, "for", "end").map_err(at)?;
                    let (var, range) = parse_for(rest, vars).map_err(at)?;
                    let shadowed = vars.get(&var).copied();
                    for value in range {
                        vars.insert(var.clone(), value);
                        self.block(&lines[i + 1..end], first + i + 1, vars, out)?;
                    }
                    match shadowed {
                        Some(value) => vars.insert(var, value),
                        None => vars.remove(&var),
                    };
                    i = end + 1;
                }
                other => return Err(at(format!("unknown directive #{other}"))),
            }
        }
        Ok(())
    }
}

/// The line of the `close` that matches the `open` at `from`, and of its `#else` if there is one.
fn matching(lines: &[&str], from: usize, open: &str, close: &str) -> Result<(Option<usize>, usize), String> {
    let mut depth = 0usize;
    let mut middle = None;
    for (i, line) in lines.iter().enumerate().skip(from) {
        let Some(directive) = line.trim_start().strip_prefix('#') else { continue };
        let word = directive.split_whitespace().next().unwrap_or("");
        if word == open {
            depth += 1;
        } else if word == close {
            depth -= 1;
            if depth == 0 {
                return Ok((middle, i));
            }
        } else if word == "else" && depth == 1 && open == "if" {
            middle = Some(i);
        }
    }
    Err(format!("#{open} without #{close}"))
}

/// Parses `i in A..B`.
fn parse_for(text: &str, vars: &Defines) -> Result<(String, std::ops::Range<i64>), String> {
    let bad = || format!("expected `#for i in A..B`, found `{text}`");
    let (var, range) = text.split_once(" in ").ok_or_else(bad)?;
    let (from, to) = range.split_once("..").ok_or_else(bad)?;
    let bound = |s: &str| -> Result<i64, String> {
        let text = substitute(s.trim(), vars)?;
        text.parse().map_err(|_| format!("`{text}` is not an integer bound"))
    };
    Ok((var.trim().to_owned(), bound(from)?..bound(to)?))
}

/// Replaces every `$name` and `${expression}` of a line.
fn substitute(line: &str, vars: &Defines) -> Result<String, String> {
    let mut out = String::with_capacity(line.len());
    let mut rest = line;
    while let Some(at) = rest.find('$') {
        out.push_str(&rest[..at]);
        let after = &rest[at + 1..];
        let (expression, tail) = if let Some(inner) = after.strip_prefix('{') {
            inner.split_once('}').ok_or("`${` without `}`")?
        } else {
            // A bare name is one lower-case letter (loop variables) or a run of capitals and digits.
            let len = match after.as_bytes().first() {
                Some(b) if b.is_ascii_lowercase() => 1,
                Some(b) if b.is_ascii_uppercase() => {
                    after.bytes().take_while(|b| b.is_ascii_uppercase() || b.is_ascii_digit()).count()
                }
                _ => return Err("`$` without a name".to_owned()),
            };
            after.split_at(len)
        };
        out.push_str(&evaluate(expression, vars)?.to_string());
        rest = tail;
    }
    out.push_str(rest);
    Ok(out)
}

/// Integer arithmetic: `*` and `/` bind tighter than `+` and `-`; no parentheses.
fn evaluate(expression: &str, vars: &Defines) -> Result<i64, String> {
    let mut sum = 0i64;
    let (mut sign, mut product, mut divide) = (1i64, None::<i64>, false);
    let mut atom = String::new();
    let flush = |atom: &mut String, product: &mut Option<i64>, divide: bool| -> Result<(), String> {
        let name = atom.trim();
        let value = match name.parse::<i64>() {
            Ok(v) => v,
            Err(_) => *vars.get(name).ok_or_else(|| format!("`{name}` is not defined"))?,
        };
        *product = Some(match *product {
            None => value,
            Some(_) if divide && value == 0 => return Err("division by 0".to_owned()),
            Some(p) if divide => p / value,
            Some(p) => p * value,
        });
        atom.clear();
        Ok(())
    };
    for c in expression.chars() {
        match c {
            '*' | '/' => {
                flush(&mut atom, &mut product, divide)?;
                divide = c == '/';
            }
            '+' | '-' => {
                flush(&mut atom, &mut product, divide)?;
                sum += sign * product.take().unwrap_or(0);
                divide = false;
                sign = if c == '+' { 1 } else { -1 };
            }
            _ => atom.push(c),
        }
    }
    flush(&mut atom, &mut product, divide)?;
    Ok(sum + sign * product.unwrap_or(0))
}

#[cfg(test)]
mod tests {
    use super::{Defines, compose, evaluate};

    fn run(source: &str, defines: &[(&str, i64)]) -> Result<String, String> {
        let vars: Defines = defines.iter().map(|(k, v)| ((*k).to_owned(), *v)).collect();
        compose(source, &vars, &|name| Ok(format!("// {name}")))
    }

    #[test]
    fn loops_nest_and_substitute() {
        let text = run("#for i in 0..2\n#for j in 0..$N\na${i}_$j=${i*4+j};\n#end\n#end\n", &[("N", 2)]);
        assert_eq!(text.as_deref(), Ok("a0_0=0;\na0_1=1;\na1_0=4;\na1_1=5;\n"));
    }

    #[test]
    fn conditions_take_one_branch() {
        let source = "#if A\nyes\n#else\nno\n#endif\n#if !A\nalso no\n#endif\n";
        assert_eq!(run(source, &[("A", 1)]).as_deref(), Ok("yes\n"));
        assert_eq!(run(source, &[]).as_deref(), Ok("no\nalso no\n"));
    }

    #[test]
    fn modules_are_imported_once() {
        assert_eq!(run("#import m\n#import m\n", &[]).as_deref(), Ok("// m\n"));
    }

    #[test]
    fn errors_name_the_line() {
        assert_eq!(run("x\n$N\n", &[]), Err("line 2: `N` is not defined".to_owned()));
        assert!(run("#if A\n", &[]).is_err_and(|e| e.contains("without #endif")));
        assert!(run("#wrong\n", &[]).is_err_and(|e| e.contains("unknown directive")));
    }

    #[test]
    fn arithmetic_has_precedence() {
        let vars: Defines = [("i".to_owned(), 3)].into();
        assert_eq!(evaluate("1+i*2-8/4", &vars), Ok(5));
    }
}
