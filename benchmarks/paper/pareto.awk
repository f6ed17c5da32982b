# pareto.awk -- the trade-off of one `cohort` as SVG: surface distance against generalization with one
# mode, means of the seeds, below left is better.
#   awk -v cohort=NAME -v unit=mm -f pareto.awk SPEC results.csv
FILENAME == ARGV[1] {
    if ($1 == "setting") order[++settings] = $2
    next
}
FNR == 1 { FS = ","; $0 = $0; next }
$1 == cohort {
    runs[$2]++
    sum[$2, 1] += $8
    sum[$2, 2] += $9
    sum[$2, 3] += $12
}
function mean(s, k) { return sum[s, k] / runs[s] }
function round_step(range,    p) {
    p = 10 ^ int(log(range) / log(10) + 10) / 10 ^ 10
    return range / p >= 6 ? 2 * p : range / p >= 3 ? p : range / p >= 1.4 ? p / 2 : p / 5
}
function line(x1, y1, x2, y2, style) {
    printf "<path d=\"M%.1f %.1fL%.1f %.1f\" %s/>\n", x1, y1, x2, y2, style
}
function text(x, y, anchor, s) {
    printf "<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"%s\">%s</text>\n", x, y, anchor, s
}
function at_x(v) { return left + 340 * (v - low[3]) / (high[3] - low[3]) }
function at_y(v, k) { return 250 - 225 * (v - low[k]) / (high[k] - low[k]) }
# These lie far away and would squeeze the others: the table has them.
function shown(s) { return runs[s] && s !~ /^(xu|fidelity-1$|adaptive-1-2alpha)/ }
# A short name beside its mark (c: adaptive, F: fidelity), or lower if one stands there.
function label(x, y, s,    i, free) {
    sub(/^adaptive-/, "c ", s)
    sub(/^fidelity-/, "F ", s)
    sub(/-c/, ", c ", s)
    while (!free) {
        free = 1
        for (i = 1; i <= labels; i++)
            if (label_x[i] - x < 5 * length(s) && x - label_x[i] < label_w[i] && label_y[i] - y < 9 && y - label_y[i] < 9)
                free = 0
        if (!free) y += 3
    }
    label_x[++labels] = x
    label_y[labels] = y
    label_w[labels] = 5 * length(s)
    text(x, y, "start", s)
}
function mark(s, x, y) {
    if (s ~ /^fidelity/) printf "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"3.5\"/>\n", x, y
    else if (s ~ /^adaptive/)
        printf "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"3.5\" fill=\"#fff\" stroke=\"#000\"/>\n", x, y
    else printf "<path d=\"M%.1f %.1fl4.5 8h-9z\" fill=\"%s\" stroke=\"#000\"/>\n", x, y - 5, \
        s ~ /256/ ? "#777" : "#fff"
}
function bounds(k,    i, s, v, range) {
    low[k] = 1e9
    high[k] = -1e9
    for (i = 1; i <= settings; i++) {
        s = order[i]
        if (!shown(s)) continue
        v = mean(s, k)
        if (v < low[k]) low[k] = v
        if (v > high[k]) high[k] = v
    }
    range = high[k] - low[k]
    low[k] -= range * 0.08
    high[k] += range * (k == 3 ? 0.25 : 0.08)
}
function panel(k, title, x0,    v, by, i, s) {
    left = x0
    labels = 0
    by = round_step(high[k] - low[k])
    for (v = by * int(low[k] / by + 1); v < high[k]; v += by) {
        line(left, at_y(v, k), left + 340, at_y(v, k), "stroke=\"#ddd\"")
        text(left - 4, at_y(v, k) + 4, "end", sprintf("%.4g", v))
    }
    by = round_step(high[3] - low[3])
    for (v = by * int(low[3] / by + 1); v < high[3]; v += by) {
        line(at_x(v), 25, at_x(v), 250, "stroke=\"#ddd\"")
        text(at_x(v), 264, "middle", sprintf("%.4g", v))
    }
    printf "<path d=\"M%.1f 25V250h340\" fill=\"none\" stroke=\"#000\"/>\n", left
    text(left + 170, 282, "middle", "generalization, one mode (" unit ")")
    text(left + 170, 16, "middle", "two-way surface distance, " title " (" unit ")")
    for (i = 1; i <= settings; i++) {
        s = order[i]
        if (!shown(s)) continue
        mark(s, at_x(mean(s, 3)), at_y(mean(s, k), k))
        label(at_x(mean(s, 3)) + 7, at_y(mean(s, k), k) + 3, s)
    }
}
END {
    bounds(1)
    bounds(2)
    bounds(3)
    printf "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 860 290\" "
    print "font-family=\"sans-serif\" font-size=\"9\" stroke=\"none\" fill=\"#000\">"
    print "<rect width=\"860\" height=\"290\" fill=\"#fff\"/>"
    panel(1, "mean", 50)
    panel(2, "mean of the maxima", 490)
    print "</svg>"
}
