// Which rays a kernel makes, behind its block of parameters: two tables of a number for each item, rt_gpu's
// `RayRecipe`.

// The number of item `item` in the table that begins at word `table`, written as `Work` names rays: the number of
// ranges and, for each, its first item and that item's number; or 0 and a number for each item.
fn named(table: u32, item: u32) -> u32 {
    let ranges = recipe.words[table];
    let rows = table + 1u;
    if ranges == 0u {
        return recipe.words[rows + item];
    }
    // The last range that does not begin behind the item.
    var low = 0u;
    var high = ranges;
    while high - low > 1u {
        let middle = (low + high) / 2u;
        if recipe.words[rows + 2u * middle] <= item {
            low = middle;
        } else {
            high = middle;
        }
    }
    return recipe.words[rows + 2u * low + 1u] + (item - recipe.words[rows + 2u * low]);
}
