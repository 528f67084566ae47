//! Better words about slips on the command line: the command that has a flag, in place of flags that only look alike.

use std::ffi::OsString;

use clap::builder::StyledStr;
use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Command, CommandFactory, FromArgMatches};

use super::Cli;

/// Largest number of letters by which a flag may differ from a suggestion.
const NEAR: usize = 2;

/// Reads the command line. Mistakes, `--help` and `--version` end the program.
pub fn parse() -> Cli {
    try_parse(std::env::args_os()).unwrap_or_else(|error| error.exit())
}

/// Reads a command line. Flags with values take negative numbers, which their own parsers refuse with better words.
fn try_parse(
    args: impl IntoIterator<Item = impl Into<OsString> + Clone>,
) -> clap::error::Result<Cli> {
    let matches = with_negative_numbers(Cli::command()).try_get_matches_from(args);
    matches
        .and_then(|matches| Cli::from_arg_matches(&matches))
        .map_err(explained)
}

fn with_negative_numbers(command: Command) -> Command {
    let command = command.mut_args(|arg| {
        if arg.is_positional() || !arg.get_action().takes_values() {
            arg
        } else {
            arg.allow_negative_numbers(true)
        }
    });
    command.mut_subcommands(with_negative_numbers)
}

/// The error with better tips.
fn explained(mut error: clap::Error) -> clap::Error {
    let text = |error: &clap::Error, kind| match error.get(kind) {
        Some(ContextValue::String(text)) => Some(text.clone()),
        _ => None,
    };
    match error.kind() {
        ErrorKind::UnknownArgument => {
            let Some(flag) = text(&error, ContextKind::InvalidArg) else {
                return error;
            };
            let near = match error.get(ContextKind::SuggestedArg) {
                Some(ContextValue::String(other)) => {
                    distance(&flag, other) <= NEAR || is_start(&flag, other)
                }
                _ => false,
            };
            if !near {
                // "To pass it as a value" is what nobody wants who has mistaken a flag.
                for kind in [
                    ContextKind::SuggestedArg,
                    ContextKind::SuggestedValue,
                    ContextKind::SuggestedSubcommand,
                    ContextKind::TrailingArg,
                    ContextKind::Suggested,
                    ContextKind::Usage,
                ] {
                    error.remove(kind);
                }
                let mut cli = Cli::command();
                cli.build();
                let homes = homes(&cli, flag.trim_start_matches('-'));
                if !homes.is_empty() {
                    let tip = format!("`{flag}` is a flag of {}", homes.join(", "));
                    let tip = ContextValue::StyledStrs(vec![StyledStr::from(tip)]);
                    error.insert(ContextKind::Suggested, tip);
                }
            }
        }
        ErrorKind::InvalidSubcommand => {
            let Some(word) = text(&error, ContextKind::InvalidSubcommand) else {
                return error;
            };
            if word.contains(['.', '/', ':']) {
                error.remove(ContextKind::SuggestedSubcommand);
                let tip = format!("to render a scene: antumbra render {word}");
                let tip = ContextValue::StyledStrs(vec![StyledStr::from(tip)]);
                error.insert(ContextKind::Suggested, tip);
            }
        }
        ErrorKind::MissingRequiredArgument => {
            let is_scene = |arg: &String| arg.starts_with("<SCENE>");
            let missing = match error.get(ContextKind::InvalidArg) {
                Some(ContextValue::Strings(all)) => all.iter().any(is_scene),
                _ => false,
            };
            if missing && std::env::args_os().any(|arg| arg == "--terrain") {
                let tip = "the scene goes before `--terrain`, which takes several files";
                let tip = ContextValue::StyledStrs(vec![StyledStr::from(tip)]);
                error.insert(ContextKind::Suggested, tip);
            }
        }
        _ => {}
    }
    error
}

/// Whether the beginning of a flag was written, two letters at least.
fn is_start(flag: &str, other: &str) -> bool {
    flag.len() >= "--ab".len() && other.starts_with(flag)
}

/// Names of the commands that have a flag of this long name.
fn homes(command: &Command, long: &str) -> Vec<String> {
    let mut found = Vec::new();
    let mut waiting = vec![(command, String::new())];
    while let Some((command, name)) = waiting.pop() {
        let has = |arg: &clap::Arg| {
            let aliases = arg.get_all_aliases().unwrap_or_default();
            arg.get_long() == Some(long) || aliases.contains(&long)
        };
        if command.get_arguments().any(has) && !name.is_empty() {
            found.push(format!("`{name}`"));
        }
        for sub in command.get_subcommands() {
            waiting.push((sub, format!("{name} {}", sub.get_name()).trim().to_owned()));
        }
    }
    found.sort();
    found
}

/// Number of letters to insert, leave out or replace (Levenshtein).
fn distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut diagonal = std::mem::replace(&mut row[0], i + 1);
        for (j, y) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(x != *y);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(args: &[&str]) -> String {
        try_parse(args).expect_err("a slip").to_string()
    }

    #[test]
    fn slips_are_told_what_helps() {
        // Near enough.
        let text = said(&["antumbra", "render", "a.pbrt", "--colapse", "area"]);
        assert!(text.contains("'--collapse'"), "{text}");
        // The beginning of a flag.
        let text = said(&["antumbra", "render", "a.pbrt", "--cam", "x"]);
        assert!(text.contains("'--camera'"), "{text}");
        // Another command's flag.
        let text = said(&["antumbra", "render", "a.pbrt", "--bent-normals"]);
        assert!(text.contains("flag of `ao`"), "{text}");
        assert!(!text.contains("as a value"), "{text}");
        // No flag at all: nothing is suggested.
        let text = said(&["antumbra", "render", "a.pbrt", "--clap"]);
        assert!(!text.contains("tip"), "{text}");
        // A scene in place of a command.
        let text = said(&["antumbra", "a.pbrt"]);
        assert!(text.contains("antumbra render a.pbrt"), "{text}");
        let text = said(&["antumbra", "rendr", "a.pbrt"]);
        assert!(text.contains("'render'"), "{text}");
    }

    #[test]
    fn negative_numbers_reach_the_parsers_of_their_flags() {
        let sun = ["antumbra", "sun", "a.obj", "-o", "o.csv", "--vertices"];
        let place = ["--lat", "1", "--lon", "2", "--step", "-1"];
        let render = ["antumbra", "render", "a.pbrt"];
        for (args, right) in [
            (&[&sun[..], &place].concat()[..], "a number above 0"),
            (&[&render[..], &["--crop", "-5,0,9x9"]].concat(), "X,Y,WxH"),
            (&[&render[..], &["--noise", "-1"]].concat(), "1% or 0.01"),
            (&[&render[..], &["--threads", "-1"]].concat(), "-1"),
        ] {
            let text = said(args);
            assert!(text.contains("invalid value"), "{text}");
            assert!(text.contains(right), "{text}");
        }
    }

    #[test]
    fn distances_count_letters() {
        for (a, b, count) in [
            ("", "abc", 3),
            ("crop", "drop", 1),
            ("spp", "pps", 2),
            ("--a", "--a", 0),
        ] {
            assert_eq!(distance(a, b), count, "{a} {b}");
            assert_eq!(distance(b, a), count, "{b} {a}");
        }
    }
}
