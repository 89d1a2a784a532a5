// Runs the glTF validator of Khronos on files. Usage: node validate_gltf.cjs FILE.... Needs the package gltf-validator;
// exit status 77 without it, 1 if it finds an error or a warning.
const fs = require("fs");
let validator;
try {
    validator = require("gltf-validator");
} catch (missing) {
    console.log(missing.message.split("\n")[0]);
    process.exit(77);
}

async function main(files) {
    for (const file of files) {
        const { issues } = await validator.validateBytes(new Uint8Array(fs.readFileSync(file)));
        console.log(`${issues.numErrors} errors, ${issues.numWarnings} warnings, ${issues.numHints} hints`);
        if (issues.numErrors + issues.numWarnings + issues.numHints > 0) {
            console.log(JSON.stringify(issues.messages.slice(0, 5)));
            process.exitCode = 1;
        }
    }
}

main(process.argv.slice(2));
