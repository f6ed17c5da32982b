# New shapes by a finished model: fits shared by several jobs. See contrib/README.md.
inputs = config["inputs"]
model = config["model"]
fits = config["fits"]
shards = int(config.get("shards", 4))
options = config.get("options", "")
apsm = config.get("apsm", "apsm")


rule all:
    input:
        fits + "/fit.json",


rule share:
    output:
        temp(touch(fits + ".share-{k}.done")),
    wildcard_constraints:
        k="[0-9]+",
    shell:
        "{apsm} fit {model} {inputs} -o {fits} {options} --shard {wildcards.k}/{shards}"


# It fails where a shape was not fitted, which fit.csv tells: the others are no less good.
rule gather:
    input:
        expand(fits + ".share-{k}.done", k=range(1, shards + 1)),
    output:
        fits + "/fit.json",
    shell:
        "{apsm} fit {model} {inputs} -o {fits} {options} || [ -e {output} ]"
