// Only here do the library's errors become Python exceptions.
#include <pybind11/pybind11.h>

#include "register.hpp"
#include "shapegcode/error.hpp"

namespace py = pybind11;

namespace shapegcode::bindings {
namespace {

struct ExceptionTypes {
  PyObject* program = nullptr;
  PyObject* design = nullptr;
  PyObject* argument = nullptr;
  PyObject* numeric = nullptr;
};

ExceptionTypes& types() {
  static ExceptionTypes instance;
  return instance;
}

PyObject* make_type(py::module_& module, const char* name, const py::tuple& bases, const char* doc) {
  const py::object type = py::reinterpret_borrow<py::object>(reinterpret_cast<PyObject*>(&PyType_Type))(
      name, bases, py::dict(py::arg("__doc__") = doc, py::arg("__module__") = "shapegcode._core"));
  module.attr(name) = type;
  return type.inc_ref().ptr();  // lives as long as the interpreter
}

void raise(const Error& error) {
  PyObject* type = types().numeric;
  switch (error.kind()) {
    case ErrorKind::program:
      type = types().program;
      break;
    case ErrorKind::design:
      type = types().design;
      break;
    case ErrorKind::argument:
      type = types().argument;
      break;
    case ErrorKind::numeric:
      break;
  }
  const py::object instance = py::reinterpret_borrow<py::object>(type)(error.what());
  if (error.kind() == ErrorKind::program) {
    instance.attr("line") = error.line();
    instance.attr("column") = error.column();
    instance.attr("alarm") = error.alarm();
    instance.attr("file") = error.file();
  }
  PyErr_SetObject(type, instance.ptr());
}

}  // namespace

void register_errors(py::module_& module) {
  const py::object exception = py::reinterpret_borrow<py::object>(PyExc_Exception);
  const py::object value_error = py::reinterpret_borrow<py::object>(PyExc_ValueError);
  const py::object base = py::reinterpret_steal<py::object>(
      make_type(module, "ShapegcodeError", py::make_tuple(exception), "Base of every error that shapegcode raises."));
  base.inc_ref();
  types().program =
      make_type(module, "ProgramError", py::make_tuple(base),
                "The CNC program cannot be read. `line` and `column` count from 1 (0: not known); `alarm`: FANUC's "
                "number (0: none); `file`: name of its file (empty: the program itself).");
  module.attr("ProgramError").attr("line") = 0;
  module.attr("ProgramError").attr("column") = 0;
  module.attr("ProgramError").attr("alarm") = 0;
  module.attr("ProgramError").attr("file") = "";
  types().design = make_type(module, "DesignError", py::make_tuple(base),
                             "The requested shaper does not exist, or not on this grid, or cannot be computed.");
  types().argument =
      make_type(module, "ArgumentError", py::make_tuple(base, value_error), "A value is outside its stated range.");
  types().numeric = make_type(module, "NumericError", py::make_tuple(base),
                              "A solver failed or did not converge; the message says which.");
  py::register_exception_translator([](std::exception_ptr pointer) {
    try {
      if (pointer) {
        std::rethrow_exception(pointer);
      }
    } catch (const Error& error) {
      raise(error);
    }
  });
}

}  // namespace shapegcode::bindings
