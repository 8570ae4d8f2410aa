# Writes OUTPUT, a source file that holds the text of every model in MODELS_DIR: a program finds them wherever
# it is installed.
file(GLOB models ${MODELS_DIR}/*.xml)
set(cases "")
foreach(model ${models})
  get_filename_component(name ${model} NAME_WE)
  file(READ ${model} text)
  string(APPEND cases "  if (name == \"${name}\") {\n    return R\"mjcf(${text})mjcf\";\n  }\n")
endforeach()
file(WRITE ${OUTPUT} "#include \"pmeta_core/env/mujoco_model.h\"

const char* pmeta::shippedModel(const std::string& name) {
${cases}  return nullptr;
}
")
