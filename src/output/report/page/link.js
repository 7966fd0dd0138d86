// The chosen object in the address of the page, so that the address can be kept, sent and opened again.

/** The name of an object for the address: the uid survives another run, the id does not. */
function linkName(table, row) {
  const uid = table.columns.findIndex(({ name }) => name === "uid");
  return String(table.values[Math.max(0, uid)][row]);
}

/** The row with a name from the address, uid or id; -1 if there is none. */
function linkedRow(table, name) {
  for (let row = 0; row < table.count; row++) if (linkName(table, row) === name) return row;
  return (table.values[0] ?? []).findIndex((id) => String(id) === name);
}

/** The name in the address; null where it names no object. */
function readLink() {
  const coded = /^#object=(.+)$/.exec(location.hash)?.[1];
  if (!coded) return null;
  try { return decodeURIComponent(coded); } catch { return coded; }
}

/** Writes a name into the address; null removes it. */
function writeLink(name) {
  if (name === readLink()) return;
  const [page] = location.href.split("#");
  // A page inside another one may not change its address. It works all the same.
  try { history.replaceState(null, "", name === null ? page : `${page}#object=${encodeURIComponent(name)}`); } catch (error) { console.debug(error.message); }
}
