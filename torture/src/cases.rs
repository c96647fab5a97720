//! The commands that write, and how each is continued after it died.

/// A command with the folder that it writes into.
///
/// In its words, `RUN` stands for that folder; others in capitals are names of [`PREPARED`] and [`SMALL`].
#[derive(Debug, Clone, Copy)]
pub struct Case {
    /// The command, or what it does.
    pub name: &'static str,
    /// Its words.
    pub command: &'static str,
    /// The command that continues what is left of it.
    pub go_on: &'static str,
    /// A folder of which `RUN` is a copy at first.
    pub copy_of: Option<&'static str>,
}

/// What cases read, with the commands that make it.
pub const PREPARED: [(&str, &str); 4] = [
    ("TRAINED", "train-bc --preset smoke --config SMALL --out TRAINED"),
    ("COMPARED", "deviations --preset smoke --config SMALL --of start --unseen validation:1:lane --out COMPARED"),
    (
        "SHARD-1",
        "evaluate --driver tentacle cvm --lots test:1:lane --trials 1 --noise clean,paper --shard 1/2 --out SHARD-1",
    ),
    (
        "SHARD-2",
        "evaluate --driver tentacle cvm --lots test:1:lane --trials 1 --noise clean,paper --shard 2/2 --out SHARD-2",
    ),
];

/// A folder with nothing in it.
pub const EMPTY: &str = "EMPTY";

/// Settings that make trainings as short as they can be.
pub const SMALL: (&str, &str) = (
    "SMALL",
    "\
training.lots = [\"train:1:lane\"]
evaluation = { lots = [\"test:1:lane\"], elsewhere = [] }
dagger = { cloning_budget = { steps = 20 }, fit = { budget = { steps = 20 } } }
",
);

/// Every command that writes, as small as it can be; but `guard`, which trains the default and is made of a training and
/// evaluations within it as `scaling` is, and those that write single files as `export` does.
pub const CASES: [Case; 13] = [
    Case {
        name: "train-bc",
        command: "train-bc --preset smoke --config SMALL --no-eval --out RUN",
        go_on: "train-bc --resume RUN",
        copy_of: None,
    },
    Case {
        name: "train-dagger",
        command: "train-dagger --preset smoke --config SMALL --out RUN",
        go_on: "train-dagger --resume RUN",
        copy_of: None,
    },
    Case {
        name: "evaluate",
        command: "evaluate --driver tentacle cvm --lots test:1:lane --trials 1 --noise clean,paper --directions \
                  forward --out RUN",
        go_on: "evaluate --resume RUN",
        copy_of: None,
    },
    Case { name: "merge", command: "merge SHARD-1 SHARD-2 --out RUN", go_on: "evaluate --resume RUN", copy_of: None },
    Case {
        name: "tune",
        command: "tune --planner cvm --lots train:1:lane --budget 12 --out RUN",
        go_on: "tune --resume RUN",
        copy_of: None,
    },
    Case {
        name: "reproduce",
        command: "reproduce --preset smoke --config SMALL --unseen test:1:lane --out RUN",
        go_on: "reproduce --resume RUN",
        copy_of: None,
    },
    Case {
        name: "scaling",
        command: "scaling --preset smoke --config SMALL --different 2,1 --unseen validation:1:lane --out RUN",
        go_on: "scaling --resume RUN",
        copy_of: None,
    },
    Case {
        name: "rules",
        command: "rules --preset smoke --config SMALL --rule ensemble_dagger,lazy_dagger --iterations 1 --samples 100 \
                  --unseen validation:1:lane --out RUN",
        go_on: "rules --resume RUN",
        copy_of: None,
    },
    Case {
        name: "deviations",
        command: "deviations --preset smoke --config SMALL --of start --unseen validation:1:lane --out RUN",
        go_on: "deviations --resume RUN",
        copy_of: None,
    },
    Case {
        name: "generate",
        command: "generate --lots lot-b,test:2:easy --out RUN",
        go_on: "generate --lots lot-b,test:2:easy --out RUN --overwrite",
        copy_of: None,
    },
    Case { name: "render report", command: "render report RUN", go_on: "render report RUN", copy_of: Some("TRAINED") },
    Case {
        name: "render results",
        command: "render results COMPARED --to RUN/page.md",
        go_on: "render results COMPARED --to RUN/page.md",
        copy_of: Some(EMPTY),
    },
    Case {
        name: "export",
        command: "export onnx TRAINED --out RUN/policy.onnx",
        go_on: "export onnx TRAINED --out RUN/policy.onnx --overwrite",
        copy_of: Some(EMPTY),
    },
];
