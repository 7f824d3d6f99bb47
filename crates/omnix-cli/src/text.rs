//! Text on its way to a terminal. Names of files and tensors are a stranger's text: what a terminal would obey is written out.

use std::borrow::Cow;

/// `text` with control characters, and those that turn the direction of writing, as escapes such as `\u{1b}`. Line ends and
/// tabs stay.
pub(crate) fn plain(text: &str) -> Cow<'_, str> {
    escaped(text, |c| c != '\n' && c != '\t' && obeyed(c))
}

/// The same for a name within a line: line ends and tabs are written out too.
pub(crate) fn name(text: &str) -> Cow<'_, str> {
    escaped(text, obeyed)
}

fn obeyed(c: char) -> bool {
    c.is_control() || matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

fn escaped(text: &str, which: impl Fn(char) -> bool) -> Cow<'_, str> {
    if !text.chars().any(&which) {
        return Cow::Borrowed(text);
    }
    let write = |c: char| if which(c) { c.escape_default().to_string() } else { c.to_string() };
    Cow::Owned(text.chars().map(write).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_terminals_obey_is_written_out() {
        assert!(matches!(plain("café 写真\n\tsecond line"), Cow::Borrowed(_)));
        assert_eq!(
            plain("a\u{1b}]0;title\u{7}b\u{9b}31m\r\u{202e}c"),
            "a\\u{1b}]0;title\\u{7}b\\u{9b}31m\\r\\u{202e}c"
        );
        assert_eq!(name("a\nerror: b"), "a\\nerror: b");
    }
}
