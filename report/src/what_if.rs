//! What would have avoided the near-collisions of an evaluation, as a table.

use crate::markdown::{escaped, with_header};
use comfy_table::Table;
use evaluation::avoidable::Row;
use experiment::lots::ALL;

/// What stands below the table.
pub const NOTES: &str = "\
- Events: near-collisions. The other columns: how many of their places are passed, driven on from 6 s before with this one \
thing replaced: 10 s more to get 5 m beyond the place, too little at the 0.5 m/s of a tight bend.
- Nothing: by chance, or because driving on is not quite the same drive. No dead time: commands act at once. No smooth.: without \
action smoothing.
- Expert of the patch: an expert that sees the clean grid alone. Exp. 6 s: the expert drives from 6 s before.";

/// A row for each driver and group of lots: how many near-collisions (events) there are, then how many of them are passed with each
/// thing replaced.
pub fn table(rows: &[Row]) -> Table {
    let drivers = distinct(rows.iter().map(|row| (row.driver.as_str(), row.noise.as_str())));
    let replaced = distinct(rows.iter().map(|row| row.replaced.as_str()));
    // One driver is named by who asked.
    let who = if drivers.len() > 1 { &["driver", "noise"][..] } else { &[] };
    // Short, for there are a dozen beside each other.
    let short = |replaced: &str| replaced.replace("no smoothing", "no smooth.").replace("expert, ", "exp. ");
    let titles = who.iter().chain(&["lots", "events"]).map(|&title| title.to_owned());
    let mut table = with_header(titles.chain(replaced.iter().map(|replaced| short(replaced))).collect());
    let mut add = |driver: &str, noise: &str, lots: &str, rows: &[&Row]| {
        let sum = |replaced: &str, count: fn(&Row) -> u32| -> u32 {
            rows.iter().filter(|row| row.replaced == replaced).map(|row| count(row)).sum()
        };
        let near_collisions = sum(replaced[0], |row| row.near_collisions);
        let passed = replaced.iter().map(|replaced| sum(replaced, |row| row.passed));
        let counts = std::iter::once(near_collisions).chain(passed).map(|count| count.to_string());
        let names = [driver, noise].into_iter().take(who.len()).chain([lots]).map(escaped);
        table.add_row(names.chain(counts));
    };
    for &(driver, noise) in &drivers {
        let of_driver: Vec<&Row> = rows.iter().filter(|row| row.driver == driver && row.noise == noise).collect();
        let groups = distinct(of_driver.iter().map(|row| row.group.as_str()));
        for &group in &groups {
            let of_group: Vec<&Row> = of_driver.iter().copied().filter(|row| row.group == group).collect();
            add(driver, noise, group, &of_group);
        }
        if groups.len() > 1 {
            add(driver, noise, ALL, &of_driver);
        }
    }
    if drivers.len() > 1 {
        add(ALL, "", ALL, &rows.iter().collect::<Vec<_>>());
    }
    table
}

/// Each once, in the order of their first.
pub(crate) fn distinct<T: PartialEq>(all: impl Iterator<Item = T>) -> Vec<T> {
    let mut distinct = Vec::new();
    for one in all {
        if !distinct.contains(&one) {
            distinct.push(one);
        }
    }
    distinct
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_stand_by_group_and_are_added_up() {
        let row = |group: &str, replaced: &str, near_collisions, passed| Row {
            driver: "mine".to_owned(),
            noise: "paper".to_owned(),
            group: group.to_owned(),
            replaced: replaced.to_owned(),
            near_collisions,
            passed,
        };
        let rows = [
            row("hall", "clean grid", 4, 3),
            row("hall", "no dead time", 4, 1),
            row("yard", "clean grid", 2, 0),
            row("yard", "no dead time", 2, 2),
        ];
        let text = table(&rows).to_string();
        let cells: Vec<Vec<&str>> =
            text.lines().map(|line| line.split('|').map(str::trim).filter(|cell| !cell.is_empty()).collect()).collect();
        assert_eq!(cells[0], ["lots", "events", "clean grid", "no dead time"]);
        assert_eq!(cells[2], ["hall", "4", "3", "1"]);
        assert_eq!(cells[3], ["yard", "2", "0", "2"]);
        assert_eq!(cells[4], ["all", "6", "3", "3"]);
        assert_eq!(cells.len(), 5);
        let others = rows.iter().map(|row| Row { driver: "other".to_owned(), ..row.clone() });
        let text = table(&rows.iter().cloned().chain(others).collect::<Vec<_>>()).to_string();
        let last: Vec<&str> = text.lines().last().unwrap().split('|').map(str::trim).collect();
        assert_eq!(last, ["", "all", "", "all", "12", "6", "6", ""]);
    }
}
