# figures.awk -- one figure, named by `figure`, of one cohort, drawn from a spec, shapes.csv and
# modes.csv.  Greys, dashes and marks differ so that no colour is needed.
BEGIN {
    split("#000 #000 #777 #777 #000 #aaa #777", grey, " ")
    split("none|7 3|none|2 2|9 3 2 3|none|5 2", dash, "|")
}

# The settings, in the order of the spec.
FILENAME == ARGV[1] {
    if ($1 == "setting") order[++settings] = $2
    next
}
FNR == 1 { FS = ","; $0 = $0; next }
$1 != cohort { next }
FILENAME == ARGV[2] {
    if ($7 + 0 == 0) next # the template, which is warped to itself
    k = ++count[$2]
    value[$2, "mean", k] = $5
    value[$2, "max", k] = $7
    next
}
{
    if ($4 + 0 > modes[$2] + 0) modes[$2] = $4 + 0
    runs[$2, $4]++
    sum[$2, $4, 1] += $5
    sum[$2, $4, 2] += $6
    sum[$2, $4, 3] += $7
}

function text(x, y, anchor, s) {
    printf "<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"%s\">%s</text>\n", x, y, anchor, s
}
function line(x1, y1, x2, y2, style) {
    printf "<path d=\"M%.1f %.1fL%.1f %.1f\" %s/>\n", x1, y1, x2, y2, style
}
function open_svg(width, height) {
    printf "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 %d %d\" ", width, height
    printf "font-family=\"sans-serif\" font-size=\"11\" stroke=\"none\" fill=\"#000\">\n"
    printf "<rect width=\"%d\" height=\"%d\" fill=\"#fff\"/>\n", width, height
}
function log10(x) { return log(x) / log(10) }

# Sorts v[1..n].
function sort(v, n,    i, k, x) {
    for (i = 2; i <= n; i++) {
        x = v[i]
        for (k = i - 1; k > 0 && v[k] > x; k--) v[k + 1] = v[k]
        v[k + 1] = x
    }
}
# The q-quantile of sorted v[1..n], between neighbours in proportion.
function quantile(v, n, q,    at, k) {
    at = 1 + q * (n - 1)
    k = int(at)
    return k >= n ? v[n] : v[k] + (at - k) * (v[k + 1] - v[k])
}

# Box: quartiles; whiskers: farthest values within 1.5 box lengths; dots: the others.
function box(s, what, y,    n, i, v, q1, q3, lo, hi, fill) {
    n = count[s]
    for (i = 1; i <= n; i++) v[i] = value[s, what, i] + 0
    sort(v, n)
    q1 = quantile(v, n, 0.25)
    q3 = quantile(v, n, 0.75)
    lo = q1
    hi = q3
    for (i = 1; i <= n; i++) {
        if (v[i] < q1 - 1.5 * (q3 - q1) || v[i] > q3 + 1.5 * (q3 - q1))
            printf "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"1.6\"/>\n", place(v[i]), y
        else {
            if (v[i] < lo) lo = v[i]
            if (v[i] > hi) hi = v[i]
        }
    }
    fill = s ~ /^(adaptive|fidelity)/ ? "#fff" : s ~ /^xu/ ? "#ccc" : "#888"
    line(place(lo), y, place(hi), y, "stroke=\"#000\"")
    printf "<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"12\" fill=\"%s\" stroke=\"#000\"/>\n", \
        place(q1), y - 6, place(q3) - place(q1), fill
    line(place(quantile(v, n, 0.5)), y - 6, place(quantile(v, n, 0.5)), y + 6, \
         "stroke=\"#000\" stroke-width=\"2.5\"")
}
function place(x) { return left + span * (log10(x) - low) / (high - low) }

# One panel of box plots; settings without runs are left out.
function boxes(what, x0, height,    i, k, s, row, e, d) {
    left = x0
    low = 1e9
    high = -1e9
    for (i = 1; i <= settings; i++) {
        s = order[i]
        for (k = 1; k <= count[s]; k++) {
            if (log10(value[s, what, k]) < low) low = log10(value[s, what, k])
            if (log10(value[s, what, k]) > high) high = log10(value[s, what, k])
        }
    }
    low -= 0.03
    high += 0.03
    for (e = -3; e <= 3; e++) for (d = 1; d < 10; d++) {
        k = log10(d) + e
        if (k < low || k > high) continue
        line(place(10 ^ k), 12, place(10 ^ k), height - 40, "stroke=\"#ddd\"")
        if (d < 6 || d == 7) text(place(10 ^ k), height - 26, "middle", d * 10 ^ e)
    }
    for (i = 1; i <= settings; i++) if (count[order[i]]) box(order[i], what, 26 + 22 * row++)
    line(left, height - 40, left + span, height - 40, "stroke=\"#000\"")
    text(left + span / 2, height - 8, "middle", \
         "two-way surface distance, " what " of a shape (" unit ", log scale)")
}
function draw_distance(    i, rows, height) {
    for (i = 1; i <= settings; i++) if (count[order[i]]) rows++
    height = 56 + 22 * rows
    span = 340
    open_svg(860, height)
    rows = 0
    for (i = 1; i <= settings; i++) if (count[order[i]])
        text(118, 30 + 22 * rows++, "end", order[i])
    boxes("mean", 125, height)
    boxes("max", 500, height)
    print "</svg>"
}

function mark(k, x, y) {
    if (k == 1) printf "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"3\"/>\n", x, y
    if (k == 2) printf "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"3\" fill=\"#fff\" stroke=\"#000\"/>\n", x, y
    if (k == 3) printf "<path d=\"M%.1f %.1fl4 7h-8z\" fill=\"#777\"/>\n", x, y - 4
    if (k == 4) printf "<path d=\"M%.1f %.1fh6v6h-6z\" fill=\"#fff\" stroke=\"#777\"/>\n", x - 3, y - 3
    if (k == 5) printf "<path d=\"M%.1f %.1fl6 6m0 -6l-6 6\" stroke=\"#000\"/>\n", x - 3, y - 3
    if (k == 6) printf "<path d=\"M%.1f %.1fh6v6h-6z\" fill=\"#aaa\"/>\n", x - 3, y - 3
    if (k == 7) printf "<path d=\"M%.1f %.1fl4 -7h-8z\" fill=\"#fff\" stroke=\"#777\"/>\n", x, y + 4
}
function shown(s) {
    return modes[s] && (figure == "adaptivity" ? s ~ /^adaptive/ : s ~ /^(adaptive-0.5$|fidelity-0.5$|xu|psm-(128|256)-tuned)/)
}
# A round step that cuts `range` into three to seven.
function round_step(range,    p) {
    p = 10 ^ int(log10(range) + 10) / 10 ^ 10
    return range / p >= 6 ? 2 * p : range / p >= 3 ? p : range / p >= 1.4 ? p / 2 : p / 5
}
function at_x(m) { return left + span * (m - 0.6) / (last - 0.2) }
function at_y(v) { return 200 - 180 * (v - low) / (high - low) }

function panel(which, title, x0,    i, m, k, s, v, by) {
    left = x0
    low = 1e9
    high = -1e9
    for (i = 1; i <= settings; i++) {
        s = order[i]
        if (shown(s)) for (m = 1; m <= last && m <= modes[s]; m++) {
            v = sum[s, m, which] / runs[s, m]
            if (v < low) low = v
            if (v > high) high = v
        }
    }
    if (high < low) return
    v = (high - low) * 0.05
    low -= v
    high += v
    by = round_step(high - low)
    for (v = by * int(low / by + 1); v < high; v += by) {
        line(left, at_y(v), left + span, at_y(v), "stroke=\"#ddd\"")
        text(left - 4, at_y(v) + 4, "end", sprintf("%.4g", v))
    }
    for (m = 1; m <= last; m++) text(at_x(m), 215, "middle", m)
    printf "<path d=\"M%.1f 20V200h%.1f\" fill=\"none\" stroke=\"#000\"/>\n", left, span
    text(left + span / 2, 232, "middle", "modes")
    text(left + span / 2, 14, "middle", title)
    for (i = 1; i <= settings; i++) {
        s = order[i]
        if (!shown(s)) continue
        k++
        printf "<path fill=\"none\" stroke=\"%s\" stroke-width=\"1.3\" stroke-dasharray=\"%s\" d=\"", \
            grey[k], dash[k]
        for (m = 1; m <= last && m <= modes[s]; m++)
            printf "%s%.1f %.1f", m == 1 ? "M" : "L", at_x(m), at_y(sum[s, m, which] / runs[s, m])
        print "\"/>"
        for (m = 1; m <= last && m <= modes[s]; m++)
            mark(k, at_x(m), at_y(sum[s, m, which] / runs[s, m]))
    }
}
function draw_model(    i, k, x) {
    last = 10
    span = 230
    open_svg(860, 272)
    panel(1, "compactness (share of variance)", 45)
    panel(2, "generalization (" unit ")", 335)
    panel(3, "specificity (" unit ")", 625)
    for (i = 1; i <= settings; i++) if (shown(order[i])) {
        x = 20 + 140 * k++
        line(x, 254, x + 24, 254, "stroke=\"" grey[k] "\" stroke-dasharray=\"" dash[k] "\"")
        mark(k, x + 12, 254)
        text(x + 30, 258, "start", order[i])
    }
    print "</svg>"
}
END {
    if (figure == "distance") draw_distance()
    else draw_model()
}
