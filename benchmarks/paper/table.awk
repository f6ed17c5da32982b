# table.awk -- results.csv of one `cohort` as a Markdown table, in the order of the spec:
#   awk -v cohort=NAME -f table.awk SPEC results.csv
# Several seeds: the mean, and in brackets the largest difference between two seeds.
FILENAME == ARGV[1] {
    if ($1 == "setting") order[++settings] = $2
    next
}
FNR == 1 {
    FS = ","
    $0 = $0
    next
}
$1 == cohort {
    runs[$2]++
    shapes = $7
    for (k = 8; k <= 19; k++) {
        sum[$2, k] += $k
        if (runs[$2] == 1 || $k + 0 < low[$2, k]) low[$2, k] = $k + 0
        if (runs[$2] == 1 || $k + 0 > high[$2, k]) high[$2, k] = $k + 0
    }
}
function cell(s, k, format,    text) {
    text = sprintf(format, sum[s, k] / runs[s])
    if (runs[s] > 1 && (k < 15 || k > 17)) text = text sprintf(" (" format ")", high[s, k] - low[s, k])
    return " " text " |"
}
END {
    print "| setting | seeds | mean | mean of max | max | others: mean | mean of max | C(1) | G(1) | S(1) | certified of " \
        shapes " | CPU s | MB |"
    print "|---|---|---|---|---|---|---|---|---|---|---|---|---|"
    for (i = 1; i <= settings; i++) {
        s = order[i]
        if (!runs[s]) continue
        print "| " s " | " runs[s] " |" cell(s, 8, "%.3f") cell(s, 9, "%.2f") cell(s, 10, "%.2f") \
            cell(s, 18, "%.3f") cell(s, 19, "%.2f") cell(s, 11, "%.3f") cell(s, 12, "%.3f") cell(s, 13, "%.3f") cell(s, 14, "%.0f") \
            cell(s, 16, "%.0f") cell(s, 17, "%.0f")
    }
}
