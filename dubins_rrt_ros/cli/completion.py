"""`dubins_rrt completion`: the script with which a shell completes the commands, flags, map names and files of `dubins_rrt`.

All words are written into the script, since to ask the program at each press of the tab key, as argcomplete does, would take
half a second of imports. Only the names of maps are listed when they are asked for.
"""

import argparse
import re
import shlex
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from dubins_rrt_ros.planning.maps.locate import OMITTED_ENDING, maps_directory
from dubins_rrt_ros.planning.maps.readers import MAP_ENDINGS

from .commands import COMMANDS, load_arguments
from .common.parser import Parser, describe

#: Kinds of words to complete, by the placeholder that the help shows for them.
_KINDS = {"MAP": "@map", "DIR": "@folder", "FILE": "@file", "PATH.json": "@file", "PROBLEMS.json": "@file"}
#: Number of words of a flag that takes any number of them.
_MANY = 999

_BASH = """\
# Completes dubins_rrt.
_dubins_rrt_place() {  # what may stand at a place of a command, and for how many words
    offer=@flags left=0
    case $1 in
PLACES
    esac
}
_dubins_rrt() {
    local IFS=$' \\t\\n' word=${COMP_WORDS[COMP_CWORD]} command=${COMP_WORDS[1]} flags= offer= left=0 place=1 i
    if ((COMP_CWORD == 1)); then
        COMPREPLY=($(compgen -W 'COMMANDS' -- "$word"))
        return
    fi
    for ((i = 2; i < COMP_CWORD; i++)); do
        case ${COMP_WORDS[i]} in
            =) ;;  # bash cuts --flag=value there
            -[a-z-]*) _dubins_rrt_place "$command ${COMP_WORDS[i]}" ;;
            *) if ((left > 0)); then ((left -= 1)); else ((place += 1)); fi ;;
        esac
    done
    [[ $word == = ]] && word=
    case $command in
FLAGS
    esac
    ((left > 0)) || _dubins_rrt_place "$command $place"
    [[ $word == -[a-z-]* || $word == - ]] && offer=@flags
    COMPREPLY=()
    case $offer in
        @file) ;;  # the shell's own way
        @folder) IFS=$'\\n' COMPREPLY=($(compgen -d -- "$word")) ;;
        @map) IFS=$'\\n' COMPREPLY=($(compgen -W "$(MAPS)" -- "$word") $(compgen -f -- "$word")) ;;
        @flags) COMPREPLY=($(compgen -W "$flags" -- "$word")) ;;
        *) COMPREPLY=($(compgen -W "$offer" -- "$word")) ;;
    esac
    [[ $offer == @map || $offer == @folder ]] && compopt -o filenames 2>/dev/null
    [[ $offer == @file ]] || compopt +o default 2>/dev/null
    return 0
}
complete -o default -F _dubins_rrt dubins_rrt"""

_ZSH = """\
(( $+functions[compdef] )) || { autoload -Uz compinit && compinit; }
autoload -Uz bashcompinit && bashcompinit"""


def add_arguments(parser: Parser) -> None:
    """Give the parser the flags and the help of the command."""
    describe(
        parser, usage="bash|zsh|fish",
        description="Prints a script that completes commands, flags with their choices, names of installed maps, and files. "
                    "The first example does so in this bash alone, the others in each that is started from now on.",
        notes="In zsh it is `source <(dubins_rrt completion zsh)`, in fish `dubins_rrt completion fish | source`.",
        examples=['eval "$(dubins_rrt completion bash)"', "mkdir -p ~/.local/share/bash-completion/completions",
                  "dubins_rrt completion bash > ~/.local/share/bash-completion/completions/dubins_rrt"],
        exit_status="0 done, 2 wrong usage")
    parser.add_argument("shell", metavar="SHELL", choices=("bash", "zsh", "fish"), help="bash, zsh or fish")


def run(arguments: argparse.Namespace) -> int:
    """Print the script."""
    parsers = {name: load_arguments(name, Parser()) for name in COMMANDS}
    print("\n".join({"bash": _bash, "zsh": _zsh, "fish": _fish}[arguments.shell](parsers)))
    return 0


class _Place(NamedTuple):
    """A place of a command's line at which words may stand.

    Attributes:
        names: the names of the flag that the words follow; or the number of the place, where they follow none.
        words: number of words; none after a switch.
        suggestions: the words to suggest, or @map, @file or @folder, or "" where nothing is known.
        help: the first clause of the help.
    """

    names: list[str]
    words: int
    suggestions: str
    help: str


def _places(parser: argparse.ArgumentParser) -> Iterator[_Place]:
    number = 0
    for action in parser._actions:
        number += not action.option_strings
        words = action.nargs if isinstance(action.nargs, int) else _MANY if action.nargs == "+" else 1
        suggestions = " ".join(action.choices or [_KINDS.get(str(action.metavar), "")])
        clause = re.split(r" \[| \(|[;:,]", action.help or "")[0]
        yield _Place(list(action.option_strings) or [str(number)], words, suggestions, clause)


def _flags(parser: argparse.ArgumentParser) -> list[str]:
    return [name for place in _places(parser) for name in place.names if name.startswith("--")]


def _list_maps() -> str:
    """Return the shell command that lists the installed maps at the time it runs."""
    edits = [f"s/[.]{ending[1:]}$//p" if ending == OMITTED_ENDING else f"/[.]{ending[1:]}$/p" for ending in MAP_ENDINGS]
    return f"command ls {shlex.quote(str(maps_directory()))} 2>/dev/null | sed -n '{'; '.join(edits)}'"


def _bash(parsers: Mapping[str, Parser]) -> Iterator[str]:
    places = (f"        {' | '.join(repr(f'{command} {name}') for name in place.names)}) "
              f"offer={shlex.quote(place.suggestions)} left={place.words} ;;"
              for command, parser in parsers.items() for place in _places(parser) if place.words)
    flags = (f"        {command}) flags='{' '.join(_flags(parser))}' ;;" for command, parser in parsers.items())
    parts = {"PLACES": "\n".join(places), "FLAGS": "\n".join(flags), "MAPS": _list_maps(),
             "COMMANDS": " ".join([*parsers, "--help", "--version"])}
    yield re.sub("|".join(parts), lambda match: parts[match[0]], _BASH)


def _zsh(parsers: Mapping[str, Parser]) -> Iterator[str]:
    """Yield the script of bash, which zsh can read."""
    yield _ZSH
    yield from _bash(parsers)


def _fish(parsers: Mapping[str, Parser]) -> Iterator[str]:
    yield "complete -c dubins_rrt -f"
    for name, command in COMMANDS.items():
        yield f"complete -c dubins_rrt -n __fish_use_subcommand -a {name} -d {_fish_quoted(command.help)}"
    for name, parser in parsers.items():
        condition = f"complete -c dubins_rrt -n '__fish_seen_subcommand_from {name}'"
        for place in _places(parser):
            flags = "".join(f" -l {name[2:]}" for name in place.names if name.startswith("--"))
            text = f" -d {_fish_quoted(place.help)}" if flags else ""
            yield condition + flags + (" -r" if flags and place.words else "") + _fish_offer(place) + text


def _fish_offer(place: _Place) -> str:
    """Return the options of fish's `complete` for what may stand at a place."""
    if not place.words:
        return ""
    files, words = {"": ("-f", ""), "@file": ("-F", ""), "@folder": ("-f", "(__fish_complete_directories)"),
                    "@map": ("-F", f"({_list_maps()})")}.get(place.suggestions, ("-f", place.suggestions))
    return f" {files} -a {_fish_quoted(words)}" if words else f" {files}"


def _fish_quoted(text: str) -> str:
    backslash, quote = "\\", "'"
    return quote + text.replace(backslash, backslash * 2).replace(quote, backslash + quote) + quote
