// What TypeScript's own checks do not see; and that no text of a run ever becomes markup.
import tseslint from "typescript-eslint";

const MARKUP = ["innerHTML", "outerHTML", "insertAdjacentHTML", "dangerouslySetInnerHTML", "srcdoc"];

export default tseslint.config(
  { ignores: ["node_modules", "**/*.mjs", "*.js"] },
  ...tseslint.configs.strictTypeChecked,
  {
    languageOptions: { parserOptions: { projectService: true, tsconfigRootDir: import.meta.dirname } },
    rules: {
      "@typescript-eslint/restrict-template-expressions": ["error", { allowNumber: true }],
      "@typescript-eslint/no-non-null-assertion": "off", // chosen: indices are checked where they are made
      "@typescript-eslint/no-confusing-void-expression": ["error", { ignoreArrowShorthand: true }],
      "no-restricted-properties": ["error", ...MARKUP.map((property) => ({ property, message: "data is text: use textContent" }))],
      "no-restricted-syntax": [
        "error",
        ...MARKUP.map((name) => ({ selector: `JSXAttribute[name.name='${name}']`, message: "data is text" })),
        { selector: "CallExpression[callee.name='eval'], NewExpression[callee.name='Function']", message: "no code from text" },
      ],
      eqeqeq: "error",
      "@typescript-eslint/no-unused-vars": ["error", { argsIgnorePattern: "^_" }],
    },
  },
);
