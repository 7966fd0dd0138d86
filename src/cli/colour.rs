//! Colours of lines on standard error.

use std::io::IsTerminal;

/// A word for standard error in a colour (an ANSI code), if standard error is a terminal with colours: unless
/// NO_COLOR is set (no-color.org) or the terminal is `dumb`.
pub(crate) fn coloured(word: &str, code: u8) -> String {
    let set = |name: &str| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    let dumb = std::env::var_os("TERM").is_some_and(|value| value == "dumb");
    if std::io::stderr().is_terminal() && !set("NO_COLOR") && !dumb {
        format!("\u{1b}[1;{code}m{word}\u{1b}[0m")
    } else {
        word.to_owned()
    }
}

/// The colour of errors: red.
pub(crate) const RED: u8 = 31;
/// The colour of warnings: yellow.
pub(crate) const YELLOW: u8 = 33;
