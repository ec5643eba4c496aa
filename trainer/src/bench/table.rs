//! Tables for people.

/// Rows under headings: columns as wide as their widest cell, the first to the left, others to the right.
pub fn aligned(headings: &[&str], rows: &[Vec<String>]) -> String {
    let width = |cell: &str| cell.chars().count();
    let mut widths: Vec<usize> = headings.iter().map(|heading| width(heading)).collect();
    for row in rows {
        for (widest, cell) in widths.iter_mut().zip(row) {
            *widest = width(cell).max(*widest);
        }
    }
    let headings: Vec<String> = headings.iter().map(|&heading| heading.to_owned()).collect();
    let mut out = String::new();
    for row in std::iter::once(&headings).chain(rows) {
        let mut line = String::new();
        for (column, (cell, &width)) in row.iter().zip(&widths).enumerate() {
            line +=
                &if column == 0 { format!("{cell:width$}") } else { format!("  {cell:>width$}") };
        }
        out += line.trim_end();
        out.push('\n');
    }
    out
}

#[cfg(test)]
mod tests {
    #[test]
    fn columns_are_as_wide_as_their_widest_cell() {
        let row = |cells: [&str; 3]| cells.map(String::from).to_vec();
        let rows = [row(["scalar", "1.25", "−"]), row(["x", "100.00", "7"])];
        let table = super::aligned(&["kernel", "ms", "bands"], &rows);
        assert_eq!(
            table,
            "kernel      ms  bands\n\
             scalar    1.25      −\n\
             x       100.00      7\n"
        );
    }
}
