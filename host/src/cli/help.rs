//! What is made of the commands' own help: the list by purpose, completions of shells, man pages.

use std::fmt::Write as _;
use std::fs;
use std::io::{BufWriter, Write};
use std::path::PathBuf;

use clap::{Args, Command};
use clap_complete::Shell;

use super::command;
use super::error::{CliError, Outcome};

/// The commands, by what one wants to do.
const GROUPS: [(&str, &[&str]); 6] = [
    ("Look at a program", &["read", "check", "plan", "compare"]),
    ("Run it on simulated axes", &["run", "replay", "page"]),
    (
        "Drive a machine through a board",
        &["send", "resume", "panel", "watch", "parameters", "compile", "flight", "board"],
    ),
    ("Move axes by hand", &["jog", "home"]),
    ("Set up a machine, its drives, its law", &["machine", "drive", "profile", "spline"]),
    ("Set up this command", &["completions", "man"]),
];

/// `command`, with its commands listed by group.
pub(super) fn grouped(command: Command) -> Command {
    let about = |name: &str| {
        let found = command.find_subcommand(name).and_then(Command::get_about);
        found.map_or_else(String::new, ToString::to_string)
    };
    let mut list = String::new();
    for (title, names) in GROUPS {
        // Cannot fail.
        let _ = writeln!(list, "{title}:");
        for &name in names {
            let _ = writeln!(list, "  {name:<12}{}", about(name));
        }
        list.push('\n');
    }
    let template = format!(
        "{{about-with-newline}}\n{{usage-heading}} {{usage}}\n\n{list}Options:\n{{options}}{{after-help}}"
    );
    command.help_template(template)
}

const COMPLETIONS_EXAMPLES: &str = "\
Examples:
  motion completions bash > ~/.local/share/bash-completion/completions/motion
  motion completions zsh > ~/.zfunc/_motion
  motion completions fish > ~/.config/fish/completions/motion.fish";

/// Print a shell's script that completes commands, options and their values.
#[derive(Debug, Args)]
#[command(after_help = COMPLETIONS_EXAMPLES)]
pub struct CompletionsArguments {
    /// The shell.
    shell: Shell,
}

/// Prints the script.
///
/// # Errors
/// `out` can't be written.
pub fn completions(arguments: &CompletionsArguments, out: &mut dyn Write) -> Result<Outcome, CliError> {
    // The generator panics where it can't write.
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut command(), "motion", &mut script);
    out.write_all(&script).map_err(CliError::Output)?;
    Ok(Outcome::Done)
}

const MAN_EXAMPLES: &str = "\
Examples:
  motion man | man -l -                              the page of `motion`
  motion man --directory ~/.local/share/man/man1     one page for each command, replaced if they are there";

/// Print the manual as a man page, or write one for each command.
#[derive(Debug, Args)]
#[command(after_help = MAN_EXAMPLES)]
pub struct ManArguments {
    /// Folder for `motion.1`, `motion-run.1` and the others; it is made where it is not there.
    #[arg(long, value_name = "DIR")]
    directory: Option<PathBuf>,
}

/// Prints the page, or writes all of them.
///
/// # Errors
/// `out`, or a page, can't be written.
pub fn man(arguments: &ManArguments, out: &mut dyn Write) -> Result<Outcome, CliError> {
    // The list by purpose has a template of its own, which a page has no use for.
    let mut command = super::plain_command().disable_help_subcommand(true);
    command.build();
    match &arguments.directory {
        None => clap_mangen::Man::new(command).render(&mut BufWriter::new(out)).map_err(CliError::Output)?,
        Some(directory) => {
            let refused = |source| CliError::Folder { path: directory.display().to_string(), source };
            fs::create_dir_all(directory)
                .and_then(|()| clap_mangen::generate_to(command, directory))
                .map_err(refused)?;
            writeln!(out, "the pages are in {}", directory.display()).map_err(CliError::Output)?;
        }
    }
    Ok(Outcome::Done)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_command_is_in_one_group() {
        let mut listed: Vec<&str> = GROUPS.iter().flat_map(|(_, names)| names.iter().copied()).collect();
        listed.sort_unstable();
        let command = command();
        let mut there: Vec<&str> = command.get_subcommands().map(Command::get_name).collect();
        there.sort_unstable();
        assert_eq!(listed, there);
    }
}
