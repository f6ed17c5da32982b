// A state of the page in its address: #s=... holds JSON, which nobody needs to type.
const MARK = "#s=";
const number = (x, fallback) => (typeof x === "number" && Number.isFinite(x) ? x : fallback);

/** Puts the state into the address and returns the link. */
export function writeLink(state) {
  const place = location.href.split("#")[0] + MARK + encodeURIComponent(JSON.stringify(state));
  try {
    history.replaceState(null, "", place);
  } catch (error) { /* some browsers refuse this for files; the link is good all the same */ }
  return place;
}

/** The state in the address, every part checked, or null. */
export function readLink() {
  if (!location.hash.startsWith(MARK)) return null;
  try {
    const s = JSON.parse(decodeURIComponent(location.hash.slice(MARK.length)));
    const pose = {}, modes = {};
    for (const key of ["yaw", "pitch", "zoom", "x", "y"]) if (number(s.pose?.[key], null) !== null) pose[key] = s.pose[key];
    for (const [m, b] of Object.entries(s.modes ?? {})) if (/^\d+$/.test(m) && number(b, null) !== null) modes[m] = b;
    return { pose, modes, of: /^(pose|shape)$/.test(s.of) ? s.of : null, shape: String(s.shape ?? ""), part: /^[a-z]+$/.test(s.part) ? s.part : null };
  } catch (error) {
    return null;
  }
}
