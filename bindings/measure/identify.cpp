#include "measure/records.hpp"
#include "register.hpp"

namespace shapegcode::bindings {

/// Numerical core of identification: ARMA models, modal fits, equivalent mass.
void register_identification(pybind11::module_& module) {
  register_arma(module);
  register_modal_fits(module);
  register_decay_fits(module);
  register_ranking(module);
  register_equivalent_mass(module);
}

}  // namespace shapegcode::bindings
