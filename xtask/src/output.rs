//! What is printed: results on stdout, everything else on stderr. A closed pipe (`| head`) is not an error: the work
//! continues, and its files are written.

use clap::{ColorChoice, ValueEnum};
use serde::Serialize;
use sim::validate::is_hidden;
use std::fmt::Display;
use std::io::{self, ErrorKind, IsTerminal as _, Write as _};
use std::sync::Mutex;

/// Columns of a printed table at most.
const WIDTH: usize = 100;

/// When to colour.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum Color {
    /// On a terminal, unless the environment variable `NO_COLOR` is set.
    #[default]
    Auto,
    /// Always.
    Always,
    /// Never.
    Never,
}

impl Color {
    /// As given on the command line, before that is parsed: clap colours its errors, too.
    pub(crate) fn from_args() -> Self {
        let args = std::env::args_os().map(|arg| arg.to_string_lossy().into_owned());
        let args: Vec<_> = args.take_while(|arg| arg != "--").collect();
        let value = args.iter().enumerate().find_map(|(i, arg)| match arg.strip_prefix("--color") {
            Some("") => args.get(i + 1).map(String::as_str),
            Some(value) => value.strip_prefix('='),
            None => None,
        });
        value.and_then(|value| Self::from_str(value, false).ok()).unwrap_or_default()
    }

    pub(crate) fn of_clap(self) -> ColorChoice {
        match self {
            Self::Auto => ColorChoice::Auto,
            Self::Always => ColorChoice::Always,
            Self::Never => ColorChoice::Never,
        }
    }

    fn on_stderr(self) -> bool {
        match self {
            Self::Auto => {
                let is_plain = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
                !is_plain && io::stderr().is_terminal()
            }
            Self::Always => true,
            Self::Never => false,
        }
    }
}

/// Where commands print.
#[derive(Debug, Default)]
pub(crate) struct Output {
    is_quiet: bool,
    is_json: bool,
    /// Why results could not be printed, if not for a closed pipe.
    failed: Mutex<Option<io::Error>>,
}

impl Output {
    pub(crate) fn new(is_quiet: bool, is_json: bool) -> Self {
        Self { is_quiet, is_json, failed: Mutex::default() }
    }

    /// Prints a line of a result.
    pub(crate) fn print(&self, text: impl Display) {
        let mut stdout = io::stdout().lock();
        if let Err(error) = writeln!(stdout, "{text}").and_then(|()| stdout.flush())
            && error.kind() != ErrorKind::BrokenPipe
            && let Ok(mut failed) = self.failed.lock()
        {
            failed.get_or_insert(error);
        }
    }

    /// Prints tables, no wider than a terminal; as JSON, if that is asked for.
    ///
    /// # Errors
    /// If the data cannot be written as JSON.
    pub(crate) fn table(&self, text: impl FnOnce() -> String, data: &impl Serialize) -> anyhow::Result<()> {
        if self.is_json {
            self.print(serde_json::to_string(data)?);
        } else {
            self.print(report::markdown::fit(&text(), WIDTH));
        }
        Ok(())
    }

    /// Prints names and what they stand for.
    ///
    /// # Errors
    /// See [`Self::table`].
    pub(crate) fn names(&self, names: &[(&str, &str)]) -> anyhow::Result<()> {
        #[derive(Serialize)]
        struct Name<'a> {
            name: &'a str,
            about: &'a str,
        }
        if !self.is_json {
            let width = names.iter().map(|(name, _)| name.len()).max().unwrap_or(0);
            for (name, about) in names {
                self.print(format_args!("{name:width$}  {about}"));
            }
            return Ok(());
        }
        let names: Vec<Name<'_>> = names.iter().map(|&(name, about)| Name { name, about }).collect();
        self.table(String::new, &names)
    }

    /// Prints a line for people that is not a result; nothing with `--json`.
    pub(crate) fn remark(&self, text: impl Display) {
        if !self.is_json {
            self.print(text);
        }
    }

    /// Says what is going on: not with `--quiet`.
    pub(crate) fn note(&self, text: impl Display) {
        if !self.is_quiet {
            note(text);
        }
    }

    /// Notes, each on a line of its own.
    pub(crate) fn notes(&self, notes: &[String]) {
        for text in notes {
            self.note(text);
        }
    }

    pub(crate) fn is_quiet(&self) -> bool {
        self.is_quiet
    }

    /// Why results could not be printed.
    ///
    /// # Errors
    /// If they could not, e.g. because the disk is full.
    pub(crate) fn finish(&self) -> anyhow::Result<()> {
        let failed = self.failed.lock().ok().and_then(|mut failed| failed.take());
        failed.map_or(Ok(()), |error| Err(anyhow::Error::new(error).context("results cannot be printed")))
    }
}

/// A line on stderr, which may quote files.
pub(crate) fn note(text: impl Display) {
    line(format_args!("{}", printable(&text.to_string())));
}

pub(crate) fn line(text: impl Display) {
    // Nobody to tell if stderr is closed.
    let _ = writeln!(io::stderr().lock(), "{text}");
}

/// Text that may quote a file: without characters that a terminal obeys or that nobody sees, on as many lines as it has, and no
/// longer than an error is read.
pub(crate) fn printable(text: &str) -> String {
    let text = storage::shortened(text, storage::ERROR_CHARS_MAX);
    let mut printable = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '\n' => printable.push('\n'),
            _ if is_hidden(character) => printable.extend(character.escape_default()),
            _ => printable.push(character),
        }
    }
    printable
}

/// An error on stderr.
pub(crate) fn error(text: impl Display) {
    let text = printable(&text.to_string());
    if Color::from_args().on_stderr() {
        line(format_args!("\x1b[1;31merror:\x1b[0m {text}"));
    } else {
        line(format_args!("error: {text}"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A file's name could clear the screen, and a file of one line filled it.
    #[test]
    fn an_error_quotes_no_character_that_a_terminal_obeys_and_has_an_end() {
        assert_eq!(printable("lot \u{1b}[2J\u{9b}\r:\nτ\t2"), "lot \\u{1b}[2J\\u{9b}\\r:\nτ\\t2");
        assert_eq!(printable("a\u{202e}b\u{200b}"), "a\\u{202e}b\\u{200b}", "it would be read backwards");
        let long = printable(&"x".repeat(storage::ERROR_CHARS_MAX + 1));
        assert!(long.ends_with("x …") && long.chars().count() == storage::ERROR_CHARS_MAX + 2, "{}", long.len());
        assert_eq!(printable(&format!("scale: it is {}", 1e300)), "scale: it is 100000000000… (301 digits)");
    }
}
