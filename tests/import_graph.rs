//! Which file of a crate imports which, read from the tokens of its sources.

use crate::bench::root;
use proc_macro2::{Delimiter, TokenStream, TokenTree};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// A module by its path within the crate: `["sensing", "noise"]`, empty for the crate's root.
type Module = Vec<String>;

/// What a file imports, and what it passes on.
#[derive(Debug, Default)]
struct File {
    path: PathBuf,
    children: BTreeSet<String>,
    /// Paths as written, by the module in which they are written: an inline module is part of its file.
    paths: Vec<(Module, Vec<String>)>,
    /// Names that a `pub use` passes on, and the path they stand for.
    reexports: BTreeMap<String, Vec<String>>,
}

/// The files of a crate, by module.
#[derive(Debug, Default)]
pub(crate) struct Crate {
    files: BTreeMap<Module, File>,
}

impl Crate {
    /// Reads the crate whose root is a file such as `sim/src/lib.rs`. Code under `#[cfg(test)]` is left out.
    pub(crate) fn read(root_file: &Path) -> Self {
        let mut all = Self::default();
        all.read_module(Vec::new(), root_file.to_owned(), root_file.parent().unwrap());
        all
    }

    fn read_module(&mut self, module: Module, path: PathBuf, folder: &Path) {
        let text = std::fs::read_to_string(&path).unwrap();
        let tokens: TokenStream = text.parse().unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let mut file = File { path, ..File::default() };
        file.scan(&module, &tokens.into_iter().collect::<Vec<_>>());
        for child in &file.children {
            let beside = folder.join(format!("{child}.rs"));
            let inside = folder.join(child).join("mod.rs");
            let path = if beside.exists() { beside } else { inside };
            // A module with a `#[path]` of its own belongs to no one file.
            if path.exists() {
                self.read_module([&module[..], std::slice::from_ref(child)].concat(), path, &folder.join(child));
            }
        }
        self.files.insert(module, file);
    }

    /// Which module imports from which others.
    fn edges(&self) -> BTreeMap<&Module, BTreeSet<&Module>> {
        let of_file = |(module, file): (_, &File)| {
            let targets = file.paths.iter().filter_map(|(written_in, path)| self.target(written_in, path));
            (module, targets.filter(|target| *target != module).collect())
        };
        self.files.iter().map(of_file).collect()
    }

    /// The module that defines what a path leads to; `None` if it leads out of the crate.
    fn target(&self, written_in: &Module, path: &[String]) -> Option<&Module> {
        let mut absolute = match path.first().map(String::as_str)? {
            "crate" => path[1..].to_vec(),
            "self" => [written_in, &path[1..]].concat(),
            "super" => {
                let ups = path.iter().take_while(|part| *part == "super").count();
                let above = written_in.len().checked_sub(ups)?;
                [&written_in[..above], &path[ups..]].concat()
            }
            first => {
                // A child of this file, or what it passes on and uses itself. Other names are of other crates, or imported
                // by a `use`, which is a path of its own.
                let child = [&written_in[..], &[first.to_owned()]].concat();
                let is_passed_on = self.files.get(written_in).is_some_and(|file| file.reexports.contains_key(first));
                let is_child = path.len() > 1 && self.files.contains_key(&child);
                (is_child || is_passed_on).then_some(())?;
                [&written_in[..], path].concat()
            }
        };
        // Follow what modules pass on.
        for _ in 0..8 {
            let depth = (0..=absolute.len()).rev().find(|&n| self.files.contains_key(&absolute[..n]))?;
            let (module, file) = self.files.get_key_value(&absolute[..depth])?;
            let passed_on = absolute.get(depth).and_then(|name| file.reexports.get(name));
            match passed_on {
                Some(path) if path.first().is_some_and(|first| first == "crate" || file.children.contains(first)) => {
                    let start = if path[0] == "crate" { path[1..].to_vec() } else { [module, &path[..]].concat() };
                    absolute = [&start[..], &absolute[depth + 1..]].concat();
                }
                _ => return Some(module),
            }
        }
        None
    }

    /// A circle of imports, as file names, or `None`.
    pub(crate) fn circle(&self) -> Option<String> {
        let mut edges = self.edges();
        // Whatever imports nothing that is left is part of no circle.
        while let Some(leaf) = edges.iter().find(|(_, targets)| targets.is_empty()).map(|(module, _)| *module) {
            edges.remove(leaf);
            for targets in edges.values_mut() {
                targets.remove(leaf);
            }
        }
        let mut way = vec![*edges.keys().next()?];
        loop {
            let next = *edges[way.last().unwrap()].first().unwrap();
            way.push(next);
            if let Some(start) = way.iter().position(|module| *module == next).filter(|&start| start + 1 < way.len()) {
                let name = |module: &&Module| {
                    let path = &self.files[*module].path;
                    path.strip_prefix(root()).unwrap_or(path).display().to_string()
                };
                return Some(way[start..].iter().map(name).collect::<Vec<_>>().join(" → "));
            }
        }
    }

    /// How many files were read.
    pub(crate) fn len(&self) -> usize {
        self.files.len()
    }
}

impl File {
    fn scan(&mut self, module: &Module, tokens: &[TokenTree]) {
        let mut at = 0;
        while at < tokens.len() {
            if is_cfg_test(&tokens[at..]) {
                at = end_of_item(tokens, at + 2);
            } else if is_word(tokens.get(at), "mod") && matches!(tokens.get(at + 1), Some(TokenTree::Ident(_))) {
                let name = tokens[at + 1].to_string();
                match tokens.get(at + 2) {
                    Some(TokenTree::Group(body)) => {
                        let inside = [&module[..], &[name]].concat();
                        self.scan(&inside, &body.stream().into_iter().collect::<Vec<_>>());
                    }
                    _ => drop(self.children.insert(name)),
                }
                at += 3;
            } else if is_word(tokens.get(at), "use") {
                let end = end_of_item(tokens, at);
                let is_public = at > 0
                    && (is_word(tokens.get(at - 1), "pub")
                        || at > 1
                            && is_word(tokens.get(at - 2), "pub")
                            && matches!(tokens[at - 1], TokenTree::Group(_)));
                let mut leaves = Vec::new();
                use_tree(&tokens[at + 1..end - 1], &[], &mut leaves);
                for (path, name) in leaves {
                    // What is passed on from a child, or from elsewhere, is imported by whoever names it.
                    if is_public && !path.is_empty() {
                        self.reexports.insert(name, path);
                    } else {
                        self.paths.push((module.clone(), path));
                    }
                }
                at = end;
            } else if matches!(tokens[at], TokenTree::Ident(_)) {
                let (path, next) = path_at(tokens, at);
                // The words of `pub(crate)` and of `self.field` lead nowhere.
                if path.len() > 1 || !["crate", "self", "super"].contains(&path[0].as_str()) {
                    self.paths.push((module.clone(), path));
                }
                at = next;
            } else {
                if let TokenTree::Group(group) = &tokens[at] {
                    self.scan(module, &group.stream().into_iter().collect::<Vec<_>>());
                }
                at += 1;
            }
        }
    }
}

fn is_word(token: Option<&TokenTree>, word: &str) -> bool {
    matches!(token, Some(TokenTree::Ident(ident)) if ident == word)
}

fn is_sign(token: Option<&TokenTree>, sign: char) -> bool {
    matches!(token, Some(TokenTree::Punct(punct)) if punct.as_char() == sign)
}

fn is_cfg_test(tokens: &[TokenTree]) -> bool {
    let attribute = |group: &proc_macro2::Group| group.stream().to_string().replace(' ', "") == "cfg(test)";
    matches!(tokens, [sign, TokenTree::Group(group), ..] if is_sign(Some(sign), '#') && attribute(group))
}

/// The index after an item: after its `;` or its body.
fn end_of_item(tokens: &[TokenTree], from: usize) -> usize {
    let is_use = is_word(tokens.get(from), "use");
    let ends = |token: &TokenTree| match token {
        TokenTree::Group(group) => !is_use && group.delimiter() == Delimiter::Brace,
        token => is_sign(Some(token), ';'),
    };
    tokens[from..].iter().position(ends).map_or(tokens.len(), |n| from + n + 1)
}

/// The words of `a::b::c` and the index after them.
fn path_at(tokens: &[TokenTree], from: usize) -> (Vec<String>, usize) {
    let mut path = vec![tokens[from].to_string()];
    let mut at = from + 1;
    while is_sign(tokens.get(at), ':') && is_sign(tokens.get(at + 1), ':') {
        let Some(TokenTree::Ident(word)) = tokens.get(at + 2) else { break };
        path.push(word.to_string());
        at += 3;
    }
    (path, at)
}

/// Every path of a `use` with the name it is known by.
fn use_tree(tokens: &[TokenTree], prefix: &[String], leaves: &mut Vec<(Vec<String>, String)>) {
    for branch in tokens.split(|token| is_sign(Some(token), ',')) {
        let mut path = prefix.to_vec();
        let mut at = 0;
        while at < branch.len() {
            match &branch[at] {
                TokenTree::Ident(word) if word == "as" => {
                    leaves.push((path.clone(), branch[at + 1].to_string()));
                    path.clear();
                    break;
                }
                TokenTree::Ident(word) if word == "self" && !path.is_empty() => {}
                TokenTree::Ident(word) => path.push(word.to_string()),
                TokenTree::Group(group) => {
                    use_tree(&group.stream().into_iter().collect::<Vec<_>>(), &path, leaves);
                    path.clear();
                }
                _ => {}
            }
            at += 1;
        }
        if let Some(name) = path.last().cloned() {
            leaves.push((path, name));
        }
    }
}

/// Writes files into a folder of their own and looks for a circle.
fn circle_among(name: &str, files: &[(&str, &str)]) -> Option<String> {
    let folder = crate::bench::scratch(name);
    for (file, text) in files {
        let path = folder.join(file);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    }
    let folder = format!("{}/", folder.display());
    Crate::read(Path::new(&(folder.clone() + "lib.rs"))).circle().map(|circle| circle.replace(&folder, ""))
}

#[test]
fn files_that_import_each_other_are_a_circle() {
    let lib = ("lib.rs", "pub mod a; pub mod b; pub mod c;");
    let ring = [
        lib,
        ("a.rs", "use crate::b::{self, Bee};"),
        ("b.rs", "pub struct Bee; fn f() { crate::c::g(); }"),
        ("c.rs", "use super::a as other; pub fn g() {}"),
    ];
    assert_eq!(circle_among("ring", &ring).as_deref(), Some("a.rs → b.rs → c.rs → a.rs"));
    let open = [lib, ("a.rs", "use crate::b::Bee;"), ("b.rs", "pub struct Bee;"), ("c.rs", "use crate::{a, b::Bee};")];
    assert_eq!(circle_among("open", &open), None);
}

#[test]
fn a_parent_may_pass_its_child_on_but_not_use_it_while_the_child_uses_the_parent() {
    let child = ("shapes/round.rs", "use super::Point; pub struct Disc(Point);");
    let passing = "mod round; pub use round::Disc; pub struct Point;";
    let with_parent = |name, parent| circle_among(name, &[("lib.rs", "mod shapes;"), ("shapes.rs", parent), child]);
    assert_eq!(with_parent("passing", passing), None);
    let circle = Some("shapes.rs → shapes/round.rs → shapes.rs");
    let using = format!("{passing} fn f(disc: Disc) {{}}");
    assert_eq!(with_parent("using", &using).as_deref(), circle, "by the name that it passes on");
    let calling = "mod round; pub struct Point; fn f() { let _ = round::Disc::new; }";
    assert_eq!(with_parent("calling", calling).as_deref(), circle, "by a path");
}

#[test]
fn what_is_passed_on_is_imported_from_where_it_is_defined() {
    let files = |user| {
        [
            ("lib.rs", "mod outer; mod user; pub use outer::Thing;"),
            ("outer.rs", "mod inner; pub use inner::Thing; use crate::user::help;"),
            ("outer/inner.rs", "pub struct Thing;"),
            ("user.rs", user),
        ]
    };
    assert_eq!(circle_among("from-inner", &files("use crate::outer::Thing; pub fn help() {}")), None);
    assert_eq!(circle_among("from-root", &files("use crate::Thing; pub fn help() {}")), None);
    let circle = circle_among("from-outer", &files("use crate::outer::other; pub fn help() {}"));
    assert_eq!(circle.as_deref(), Some("outer.rs → user.rs → outer.rs"));
}

#[test]
fn tests_may_import_what_they_test() {
    let test = "pub struct Bee; #[cfg(test)] mod tests { use crate::a::f; } #[cfg(test)] use crate::a::f;";
    assert_eq!(
        circle_among("tests", &[("lib.rs", "mod a; mod b;"), ("a.rs", "use crate::b::Bee;"), ("b.rs", test)]),
        None
    );
}
