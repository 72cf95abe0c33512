/** Show the OpenAPI document of this service, and let people try its operations. */

const root = new URL("..", document.baseURI).href.replace(/\/$/, "");

/** @typedef {(document: object) => unknown} Update */

/** Send what people try to this service, also where a proxy has it below a path. */
const ofThisService = () => ({
  statePlugins: {
    spec: {
      wrapActions: {
        updateJsonSpec: (/** @type {Update} */ update) => (/** @type {object} */ document) => update({ ...document, servers: [{ url: root }] }),
      },
    },
  },
});

/** @type {any} */ (globalThis).SwaggerUIBundle({
  url: new URL("../api/v1/openapi.json", document.baseURI).href,
  plugins: [ofThisService],
  dom_id: "#interface",
  deepLinking: true,
  displayRequestDuration: true,
  validatorUrl: null, // the default would send the document to another server
});
