use std::collections::BTreeSet;

use clap::CommandFactory as _;

use super::*;
use crate::cli::Cli;

/// Collects every argument of type `PathBuf`, with its verb.
fn paths(command: &Command, verb: &str, found: &mut BTreeSet<String>) {
    for below in command.get_subcommands() {
        let verb = format!("{verb} {}", below.get_name());
        let is_path = |argument: &&clap::Arg| {
            argument.get_value_parser().type_id() == std::any::TypeId::of::<PathBuf>()
        };
        let named = |argument: &clap::Arg| format!("{} {}", verb.trim_start(), argument.get_id());
        found.extend(below.get_arguments().filter(is_path).map(named));
        paths(below, &verb, found);
    }
}

/// Every output path must be an `OutPath`, so that the common rules apply to it.
#[test]
fn plain_paths_are_inputs() {
    let mut found = BTreeSet::new();
    paths(&Cli::command(), "", &mut found);
    let read = [
        "calibrate logs",
        "calibrate scene",
        "collect plan",
        "collect report",
        "collect socket",
        "collect token_file",
        "collect truth",
        "collect verify",
        "compare logs",
        "compare scene",
        "export logs",
        "generate spec",
        "generate verify",
        "import file",
        "import mapping",
        "import scene",
        "interpret logs",
        "interpret scene",
        "lines laser",
        "lines logs",
        "lines scene",
        "locate logs",
        "locate scene",
        "log annotate log",
        "log repair log",
        "log show log",
        "log verify logs",
        "map logs",
        "map scene",
        "map update",
        "mock replay",
        "mock scene",
        "mock truth",
        "paths scene",
        "plot log",
        "plot scene",
        "predict log",
        "predict scene",
        "report config",
        "report logs",
        "report socket",
        "report token_file",
        "run config",
        "run scene",
        "run truth",
        "scan scene",
        "scan socket",
        "scan token_file",
        "scan truth",
        "scene check scene",
        "scene draw scene",
        "scene from-dxf drawing",
        "scene from-grid map",
        "scene from-sdf world",
        "scene from-svg drawing",
        "simulate poses",
        "simulate scene",
        "status fleet",
        "status socket",
        "status token_file",
        "survey logs",
        "trace scene",
        "watch fleet",
        "watch socket",
        "watch token_file",
        // Outputs of the daemon, with rules of the store and the server.
        "run log",
        "run socket",
    ];
    assert_eq!(found, read.map(str::to_owned).into(), "is a new path an output?");
}

#[test]
fn list_is_identified_by_members() {
    let list = Product::List(&["pose", "returns"]);
    assert!(list.replaces(b"{\"returns\":[],\"pose\":{}}\n{\"pose\":1}\n") && list.replaces(b""));
    for other in
        [&b"{\"pose\":{}}\n"[..], b"{\"returns\":[],\"pose\":{},\"more\":1}\n", b"[1]", b"x"]
    {
        assert!(!list.replaces(other), "{other:?}");
    }
}
