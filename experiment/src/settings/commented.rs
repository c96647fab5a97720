//! Settings as TOML with a comment above every key; `--config` reads it again.

use super::reference;
use super::schema::Settings;
use toml_edit::{Array, DocumentMut, Item, Table};

impl Settings {
    /// Every setting with what it means and what it may be.
    pub fn to_commented_toml(&self) -> String {
        self.commented(|_| true)
    }

    /// The settings that most users need.
    pub fn common_to_commented_toml(&self) -> String {
        self.commented(|entry| entry.common)
    }

    fn commented(&self, is_shown: impl Fn(&reference::Entry) -> bool) -> String {
        let mut document: DocumentMut = self.to_toml().parse().expect("settings are TOML");
        comment(document.as_table_mut(), "", &is_shown);
        document.to_string().trim_start().to_owned()
    }
}

/// Gives every element of a long list a line of its own.
fn break_lines(list: &mut Array) {
    const WIDTH: usize = 100;
    if list.to_string().len() <= WIDTH {
        return;
    }
    for value in list.iter_mut() {
        value.decor_mut().set_prefix("\n    ");
    }
    list.set_trailing("\n");
    list.set_trailing_comma(true);
}

/// Comments the keys of a section and drops those that are not shown.
fn comment(table: &mut Table, prefix: &str, is_shown: &impl Fn(&reference::Entry) -> bool) {
    let names: Vec<String> = table.iter().map(|(name, _)| name.to_owned()).collect();
    for name in names {
        let key = format!("{prefix}{name}");
        if let Some(Item::Table(section)) = table.get_mut(&name) {
            comment(section, &format!("{key}."), is_shown);
            if section.is_empty() {
                table.remove(&name);
            } else {
                let has_values = section.iter().any(|(_, item)| item.is_value());
                section.set_implicit(!has_values);
                section.decor_mut().set_prefix("\n");
            }
            continue;
        }
        match reference::entry(&key).filter(|entry| is_shown(entry)) {
            Some(entry) => {
                if let Some(mut key) = table.key_mut(&name) {
                    key.leaf_decor_mut().set_prefix(format!("# {}\n", entry.comment()));
                }
                if let Some(list) = table.get_mut(&name).and_then(Item::as_array_mut) {
                    break_lines(list);
                }
            }
            None => {
                table.remove(&name);
            }
        }
    }
}
