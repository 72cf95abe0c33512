/** Show the OpenAPI document of this service, and let people try its operations. */

SwaggerUIBundle({
  url: new URL("../api/v1/openapi.json", document.baseURI).href,
  dom_id: "#interface",
  deepLinking: true,
  displayRequestDuration: true,
  validatorUrl: null, // the default would send the document to another server
});
